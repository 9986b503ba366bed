import re
from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.closed_loop.loop import choose, nondominated_rows
from paretoik.closed_loop.objectives import Step, as_step_objective, step_objective
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from problems import marcos_2012
from tests.closed_loop.postures import posture


def test_the_least_weighted_sum_is_chosen_of_objectives_scaled_to_the_front():
    F = np.array([[0.0, 10.0], [1.0, 4.0], [10.0, 0.0]])
    assert choose(F, np.array([1.0, 0.0])) == 0
    assert choose(F, np.array([0.0, 1.0])) == 2
    assert choose(F, np.array([0.5, 0.5])) == 1
    assert choose(1e6 * F + 3, np.array([0.5, 0.5])) == 1
    assert choose(F[:1], np.array([0.5, 0.5])) == 0


def test_fronts_are_non_dominated_and_sorted_by_the_first_objective():
    F = np.array([[3.0, 0.0], [1.0, 1.0], [0.0, 3.0], [1.0, 2.0], [3.0, 0.0]])
    np.testing.assert_array_equal(F[nondominated_rows(F)], [[0.0, 3.0], [1.0, 1.0], [3.0, 0.0]])


def test_a_refusal_says_how_much_farther_joints_would_have_to_move():
    def refusal(longest):
        loop = ClosedLoop(
            marcos_nr(3), marcos_2012.round_trip(0.7, 25), start=posture(3), longest_step=longest, population=8
        )
        try:
            next(loop.steps())
        except Infeasible as error:
            return str(error)
        return ""

    times = re.search(r"at least (\S+) times as far as allowed: joint\d", refusal(1e-3))
    assert times is not None
    least = 1e-3 * float(times.group(1))
    assert "times as far" not in refusal(1.01 * least)
    assert "at least 1.02 times as far" in refusal(least / 1.02)


def test_an_objective_that_looks_at_other_samples_is_named():
    @step_objective(unit="rad")
    def mean(step: Step):
        return step.motion.q[..., 0].mean(axis=-1)

    loop = pk.ClosedLoop(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 4), objectives=[mean], start=posture(3))
    with pytest.raises(InvalidInput, match="objective mean"):
        loop.step_evolution()


def test_joint_displacement_counts_rates_and_what_joints_are_from_home_over_the_time_of_a_step():
    """Marcos et al. 2012, Eq. 17: ‖q̇‖² + ‖(q − q₀) / Δt‖² = (0.5² + 1) + (0.3² + 0.4²) / 0.2²."""
    motion = SimpleNamespace(q=np.array([[0.4, -0.2]]), dq=np.array([[0.5, -1.0]]))
    errors = np.zeros((1, 2))
    step = Step(motion=motion, home=np.array([0.1, 0.2]), position_error=errors, rotation_error=errors, dt=0.2)
    np.testing.assert_allclose(pk.joint_displacement.function(step), [1.25 + 0.25 / 0.04])


def test_an_objective_to_maximise_stays_one_for_steps():
    assert as_step_objective(pk.manipulability).sign == -1.0
