"""The compiled selection compared with ``search.maximin``, and the compiled search with plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from moocore import pareto_rank

from paretoik.closed_loop import step_search_kernels as engine
from paretoik.closed_loop.programs import StepStart, allocate
from paretoik.closed_loop.step_search_kernels import decode
from paretoik.search import sorted_points
from paretoik.search.maximin import survivors
from problems import marcos_2012
from tests.closed_loop.postures import posture


def selected(F, N):
    """Return which points (of two alternating populations) survive one selection after another."""
    made = allocate(3, 1, N, F.shape[1], 1)
    number = 0

    def inside(points, single_rank, new=N):
        nonlocal number
        made.children[0] = np.arange(number, number + N)
        number += N
        made.F[:, N:] = F[points].T
        if single_rank:
            sorted_points.locate(made.F, N, new, made.selection.places, made.selection.dominated)
        return engine.survive(made, new, single_rank)

    made.F[:, :N] = np.inf
    made.order[:] = np.arange(N)
    made.genes[:] = -1
    return made, inside


def fronts(kind, count, rng):
    if kind in ("noise", "three objectives"):
        return rng.normal(size=(count, 2 if kind == "noise" else 3))
    t = rng.uniform(size=count)
    if kind == "tail":
        return np.stack([t**6, (1 - t) ** 6], axis=1)
    if kind == "front":
        return np.stack([t, 1 - np.sqrt(t)], axis=1)
    return np.round(rng.uniform(size=(count, 2)), 1)  # ties and copies


@pytest.mark.parametrize("kind", ["noise", "front", "tail", "ties", "three objectives"])
@pytest.mark.parametrize("N", [4, 57])
def test_the_compiled_selection_is_that_of_maximin(kind, N):
    rng = np.random.default_rng(N)
    F = fronts(kind, 6 * N, rng)
    made, inside = selected(F, N)
    single_rank = inside(np.arange(N), False)
    parents = np.arange(N)
    for turn in range(1, 6):
        children = np.arange(turn * N, (turn + 1) * N)
        both = np.concatenate([parents, children])
        survivor_points = both[survivors(F[both], np.zeros(2 * N), N).index]
        single_rank = inside(children, single_rank)
        parents = made.genes[made.order, 0].astype(int)
        np.testing.assert_array_equal(made.F[:, :N].T, F[parents])
        if kind == "ties":  # of equal points either may stay: every rank keeps the same number
            ranks = pareto_rank(F[both])
            expected = np.sort(ranks)[:N]
            np.testing.assert_array_equal(np.sort(ranks[np.isin(both, parents)]), expected)
        else:
            assert sorted(parents) == sorted(survivor_points.tolist())


def test_failed_points_survive_only_if_no_others_are_left():
    N = 6
    F = np.concatenate([np.full((N, 2), np.inf), [[0, 1], [1, 0], [0.5, 0.5], [2, 2], [np.inf, np.inf], [3, 3]]])
    made, inside = selected(F, N)
    single_rank = inside(np.arange(N), False)
    assert not inside(np.arange(N, 2 * N), single_rank)
    assert np.isfinite(made.F[0, :N]).sum() == 5


@pytest.fixture(scope="module")
def loop():
    return marcos_2012.loop(4, 0.7, start=posture(4), steps=4, population=40, generations=15)


def test_the_same_seed_and_step_give_the_same_bits(loop):
    search, other = loop.step_evolution(), loop.step_evolution()
    first = search(loop.step_state(1))
    search(loop.step_state(2))
    for again in (search(loop.step_state(1)), other(loop.step_state(1))):
        np.testing.assert_array_equal(again.genes, first.genes)
        np.testing.assert_array_equal(again.F, first.F)
    assert not np.array_equal(search(loop.step_state(2)).genes, first.genes)


def test_kept_generations_lead_to_the_same_bits_and_each_is_that_of_a_shorter_search(loop):
    search, other = loop.step_evolution(), loop.step_evolution()
    plain = other(loop.step_state(1))
    population, kept = search.with_generations(loop.step_state(1))
    np.testing.assert_array_equal(population.F, plain.F)
    np.testing.assert_array_equal(population.genes, plain.genes)
    assert kept.F.shape == (loop.generations + 1, loop.population, 2)
    for generations in (1, 7, loop.generations):
        other.generations = generations
        shorter = other(loop.step_state(1))
        alive = np.isfinite(kept.F[generations]).all(axis=1)
        np.testing.assert_array_equal(kept.F[generations][alive], shorter.F)
        np.testing.assert_array_equal(kept.q[generations][alive], shorter.q)
        np.testing.assert_array_equal(np.isnan(kept.q[generations]).any(axis=1), ~alive)


# Genes to joint positions, compared with a dense solution of the extended Jacobian (Marcos 2012, Eqs. 7, 12, 13).


@pytest.mark.parametrize(("dof", "rows"), [(3, 2), (5, 2), (7, 6)])
def test_steps_solve_the_extended_jacobian(dof, rows):
    rng, batch, redundancy = np.random.default_rng(dof), 25, dof - rows
    jacobian, change, previous = rng.normal(size=(rows, dof)), rng.normal(size=rows), rng.normal(size=dof)
    particular = np.linalg.pinv(jacobian) @ change
    null_space = np.ascontiguousarray(np.linalg.svd(jacobian)[2][rows:].T)
    start = StepStart(previous, particular, null_space, np.zeros((3, dof)), 0.1)
    genes = rng.uniform(-1, 1, size=(redundancy * (dof + 1), batch))
    q = np.full((dof, batch), np.nan)
    decode(genes, batch, start, np.empty((redundancy * (redundancy + 1), batch)), q)
    for k in range(batch):
        extra = genes[:, k].reshape(redundancy, dof + 1)
        extended, right = np.concatenate([jacobian, extra[:, :dof]]), np.concatenate([change, extra[:, dof]])
        expected = previous + np.linalg.solve(extended, right)
        scale = np.linalg.cond(extended) * (1 + np.abs(expected).max())
        np.testing.assert_allclose(q[:, k], expected, atol=1e-13 * scale)
