"""The shortest path through a graph of layers, compared with all its paths."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.trajectory.shortest_paths import LayeredGraph, shortest_path


@pytest.mark.parametrize("cyclic", [False, True])
@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), states=st.integers(1, 5), steps=st.integers(1, 4), share=st.floats(0.3, 1.0))
def test_the_best_way_of_a_graph_is_that_of_all_its_ways(cyclic, seed, states, steps, share):
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((steps, states, states)) < share, rng.random((steps, states, states)), np.inf)
    start = rng.random(states)
    arcs = [np.nonzero(np.isfinite(cost)) for cost in costs]  # (end, source), sorted by the end
    graph = LayeredGraph(
        start=start,
        offsets=[np.searchsorted(ends, np.arange(states + 1)) for ends, _ in arcs],
        sources=[sources for _, sources in arcs],
        costs=[cost[pair] for cost, pair in zip(costs, arcs, strict=True)],
        nodes=[np.arange(states)] * (steps + 1),
    )
    ways = [w for w in itertools.product(range(states), repeat=steps + 1) if not cyclic or w[0] == w[-1]]
    values = [start[w[0]] + sum(costs[s, w[s + 1], w[s]] for s in range(steps)) for w in ways]
    best, way = shortest_path(graph, cyclic)
    assert best == pytest.approx(min(values))
    if np.isfinite(best):
        assert values[ways.index(tuple(way))] == pytest.approx(best)
