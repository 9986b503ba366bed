"""Results for verbs from a formulation, and from a plain pymoo problem without the optional parts."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.problems.multi.zdt import ZDT1

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.formulations import protocol
from paretoik.formulations.motions import restore_motions
from paretoik.formulations.protocol import ProblemParts
from tests.api.problems import tracking

PLAIN = ZDT1(n_var=3)


class Explaining:
    n_var, n_obj, constraint_names = 2, 1, ("wall", "floor")

    def explain(self, genes):
        return ["through the floor"] * len(genes)


def test_a_plain_problem_is_searched_and_has_no_motions_or_preferences():
    assert protocol.timeline(PLAIN) == "generation"
    parts = ProblemParts(PLAIN)
    assert parts.decode(np.zeros((1, 3))) is None
    assert parts.reweigh(pk.solve(PLAIN, population=8, generations=1), pk.Weights(f1=1.0)) is None
    assert not protocol.is_loop(pk.solve(PLAIN, population=8, generations=1))
    with pytest.raises(InvalidInput, match="initial must be genes, got motions, which this problem cannot encode"):
        parts.encode(None)


@pytest.mark.parametrize("odd", [5, np.arange(3)])
def test_a_pymoo_problem_is_searched_with_a_timeline_of_its_own(odd):
    problem = ZDT1(n_var=3)
    problem.timeline = odd
    assert protocol.timeline(problem) == "generation"
    assert len(pk.solve(problem, population=8, generations=1))


def test_the_limit_that_is_violated_most_is_named():
    violation = np.array([0.1, 0.5])
    assert protocol.explain_violation(PLAIN, np.zeros((1, 3)), violation) == (
        "constraint 2",
        "constraint 2 is violated by 0.5",
    )
    assert protocol.explain_violation(Explaining(), np.zeros((1, 2)), violation) == ("floor", "through the floor")


def test_tracking_encodes_what_it_decodes_and_restores_its_motions():
    problem = tracking(velocity=6.0)
    front = pk.solve(problem, population=12, generations=2)
    parts = ProblemParts(problem)
    genes, deviation = parts.encode(parts.decode(np.array(front.genes)))
    assert genes.shape == front.genes.shape
    assert deviation.max() < 1e-6
    restored = restore_motions(problem, front)
    np.testing.assert_array_equal(restored.torque, front.motions.torque)
