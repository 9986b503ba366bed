"""The closed-loop benchmark: all methods search the same step, and none beats the exact front."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks.closed_loop import __main__ as contestants
from studies.benchmarks.closed_loop import exactness
from studies.marcos_2012.exact_loop import exact_step


@pytest.fixture(scope="module", params=[3, 4])
def loop(request):
    return contestants.loop_of(request.param)


def test_no_search_goes_beyond_the_exact_front(loop):
    step = loop.step_state(1)
    exact = contestants.exact_front(loop, step)
    F = contestants.engine(loop, step)(0, 60)
    width = np.ptp(exact, axis=0)
    beyond = ((exact[None] - F[:, None]) / width).min(axis=2).max(axis=1) < -1e-3  # no exact point is near or better
    ahead = ((F[:, None] + 1e-4 * width < exact[None]).all(axis=2)).any(axis=1)
    assert not (beyond & ahead).any()
    if len(loop.start) == 3:
        assert not ahead.any()


@pytest.mark.parametrize(("links", "near"), [(3, 0.97), (4, 0.0)])
def test_engine_and_pymoo_come_as_near_to_the_exact_front(monkeypatch, links, near):
    monkeypatch.setattr(contestants, "GENERATIONS", 60)
    fronts = [contestants.search_front(links, 60, name, 0) for name in ("engine", "pymoo")]
    loop = contestants.loop_of(links, as_printed=False)
    exact = contestants.exact_front(loop, contestants.control_step(loop, 60))
    ours, theirs = contestants.volumes(fronts[:1], fronts[1:], exact)
    for volume in (ours[0], theirs[0]):
        assert near <= volume <= 1.02


@pytest.mark.parametrize("links", [3, 4])
@pytest.mark.parametrize("longest", [np.inf, 0.1])
@pytest.mark.parametrize("blocked", [False, True])
def test_dense_searches_find_no_better_step_than_the_exact_one(links, longest, blocked):
    for seed, step in enumerate(exactness.random_steps(links, 7, 2, longest, blocked)):
        assert exactness.advantage(step, seed) <= exactness.GOAL


def test_a_step_that_is_not_the_best_is_found_out(monkeypatch):
    exact = exactness.exact_step
    monkeypatch.setattr(exactness, "exact_step", lambda step, weight: exact(step, weight=min(1.0, weight + 0.05)))
    (step,) = exactness.random_steps(3, 7, 1, np.inf, False)
    assert exactness.advantage(step, 0) > 1e-4


@pytest.mark.parametrize(
    ("longest", "seed", "index"), [(np.inf, 5, 3), (np.inf, 12, 3), (np.inf, 16, 1), (0.1, 9, 0), (0.1, 6, 1)]
)
def test_no_step_near_obstacles_is_better_than_the_exact_one(longest, seed, index):
    step = list(exactness.random_steps(4, seed, index + 1, longest, blocked=True))[index]
    F = exactness.objectives(step, np.stack([exact_step(step, weight=weight) for weight in exactness.WEIGHTS]))
    weights = np.array([[weight, 1.0 - weight] for weight in exactness.WEIGHTS]) / np.abs(F[0] - F[-1])
    assert (np.einsum("wk,wk->w", F, weights) <= exactness.dense_search(step, weights, 0) + 1e-6).all()
