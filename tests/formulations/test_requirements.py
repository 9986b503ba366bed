"""What verbs refuse by name before any work, and what they take."""

from __future__ import annotations

import pytest
from pymoo.problems.multi.zdt import ZDT1

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import require_plan, require_program
from paretoik.search.genes import check_sizes
from tests.api.problems import tracking

PLAIN = ZDT1(n_var=3)


def test_any_pymoo_problem_can_be_searched_and_nothing_else():
    check_sizes(PLAIN)
    with pytest.raises(InvalidInput, match="problem: a pymoo problem wanted, such as Tracking, got 3"):
        check_sizes(3)


def test_gradients_want_a_program_and_the_verb_is_named():
    problem = tracking()
    assert require_program("refine", problem) is problem
    with pytest.raises(
        InvalidInput,
        match=r"refine: a problem with gradients wanted, .* got ZDT1, which offers no program\(\)",
    ):
        require_program("refine", PLAIN)


def test_a_plan_wants_a_tracking_of_one_objective():
    assert callable(require_plan(tracking(pk.kinetic_energy)))
    with pytest.raises(InvalidInput, match="plan: one objective wanted, got 2: kinetic_energy, torque_norm"):
        require_plan(tracking(pk.kinetic_energy, pk.torque_norm))
