"""The grid of postures: edges are all pairs within windows, windows the joints' pace within limits."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik as pk
from paretoik.task.starts import wrap_difference
from paretoik.trajectory.posture_grid import PostureGrid, step_windows
from tests.task.tasks import task


def random_grid(seed):
    """Return random nodes at three samples, with periodic joints or without."""
    rng = np.random.default_rng(seed)
    nodes = [rng.uniform(-np.pi, np.pi, (rng.integers(1, 15), 3)) for _ in range(3)]
    next_node = [np.append(np.arange(1, len(q)), -1) for q in nodes]
    turning, windows = rng.uniform(size=3) < 0.5, rng.uniform(0.3, 2.0, (3, 3))
    grid = {"nodes": nodes, "next_node": next_node, "turning": turning, "windows": windows}
    return PostureGrid(**grid, scales=np.ones(3))


seeds = st.integers(0, 10_000)


@settings(max_examples=25)
@given(seeds)
def test_edges_are_all_pairs_within_the_windows_in_order(seed):
    grid = random_grid(seed)
    for i in (1, 2):
        difference = wrap_difference(grid.nodes[i][:, None] - grid.nodes[i - 1], grid.turning)
        ends, sources = np.nonzero((np.abs(difference) <= grid.windows[i]).all(axis=2))
        np.testing.assert_array_equal(grid.edges(i), [sources, ends])


@settings(max_examples=25)
@given(seeds)
def test_a_motion_goes_the_shortest_way_between_its_nodes(seed):
    grid = random_grid(seed)
    motion = grid.motion([0, 0, 0])
    chosen = np.stack([nodes[0] for nodes in grid.nodes])
    np.testing.assert_allclose(wrap_difference(motion - chosen, grid.turning), 0.0, atol=1e-12)
    assert np.abs(np.diff(motion, axis=0)[:, grid.turning]).max(initial=0.0) <= np.pi + 1e-12


@settings(max_examples=25)
@given(seeds)
def test_a_selection_keeps_who_comes_next_where_both_stay(seed):
    grid = random_grid(seed)
    rng = np.random.default_rng(seed)
    mask = [rng.uniform(size=len(nodes)) < 0.6 for nodes in grid.nodes]
    selection = grid.select(mask)
    for nodes, following, before, stays in zip(selection.nodes, selection.next_node, grid.nodes, mask, strict=True):
        np.testing.assert_array_equal(nodes, before[stays])
        indices = np.flatnonzero(stays)
        for k, after in enumerate(following):
            joined = indices[k] + 1 < len(before) and stays[indices[k] + 1]
            assert after == (k + 1 if joined else -1)


def test_windows_are_the_pace_where_velocities_allow_it():
    along = task(limits=pk.Limits(velocity=[1.0, 100.0, 0.0]))
    windows, step = step_windows(along, 0.3), along.times[1]
    assert windows.shape == (21, 3)
    np.testing.assert_allclose(windows[:, 0], step, rtol=1e-6)
    np.testing.assert_array_equal(windows[:, 1], 0.3)
    assert (windows[:, 2] > 0).all()
    assert windows[:, 2].max() < 1e-6
