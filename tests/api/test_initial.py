from __future__ import annotations

import numpy as np
import pytest
from pymoo.problems.multi.zdt import ZDT1

import paretoik as pk
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput
from tests.api.problems import PATH, QUICK


def test_a_front_started_from_is_never_worse_in_any_objective(problem, front):
    for initial in (front, front.genes):
        better = solve(problem, population=max(12, len(front)), generations=1, seed=3, initial=initial)
        assert (better.objectives.min(axis=0) <= front.objectives.min(axis=0)).all()


def test_motions_are_encoded_as_starts_and_those_that_the_genes_miss_are_warned_of(problem, front):
    started = solve(problem, population=max(12, len(front)), generations=1, seed=3, initial=front.motions)
    np.testing.assert_array_less(started.objectives.min(axis=0), front.objectives.min(axis=0) * (1 + 1e-6))
    finer = pk.Tracking(
        pk.arms.tringali_3r(),
        PATH,
        objectives=(pk.kinetic_energy, pk.torque_norm),
        coefficients=12,
        bases=2,
        differences="backward",
    )
    wild = finer.decode(np.column_stack([np.full(4, 0.5), np.tile([0.5, -0.5], (4, 6)) * np.arange(1, 5)[:, None] / 4]))
    with pytest.warns(RuntimeWarning, match=r"initial: genes describe \d of 4 motions only approximately"):
        solve(problem, population=12, generations=1, initial=wild)


def test_a_front_of_another_problem_without_motions_cannot_be_a_start(problem):
    foreign = solve(ZDT1(n_var=5), population=8, generations=2)
    with pytest.raises(InvalidInput, match="initial must be a front of this problem, or one with motions, got neither"):
        solve(problem, **QUICK, initial=foreign)


def test_motions_cannot_start_a_problem_that_knows_none(front):
    with pytest.raises(InvalidInput, match="initial must be genes, got motions, which this problem cannot encode"):
        solve(ZDT1(n_var=5), **QUICK, initial=front.motions)
