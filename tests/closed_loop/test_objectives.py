from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.closed_loop.objectives import Step, as_step_objective, step_objective
from paretoik.errors import InvalidInput


@step_objective(unit="rad")
def elbow(step: Step):
    return np.abs(step.motion.q[..., 1])


@pk.objective(unit="rad", form="general")
def whole(motion):
    return motion.q[..., 0, 0]


def test_maximised_and_library_objectives_are_steps_objectives():
    assert as_step_objective(pk.manipulability).sign == -1.0
    assert as_step_objective(elbow) is elbow


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("given", "said"), [(whole, "whole must be of form integral or peak"), (abs, "objectives must be functions")]
)
def test_objectives_of_whole_motions_and_plain_functions_are_refused(given, said):
    with pytest.raises(InvalidInput, match=said):
        as_step_objective(given)


def test_joint_displacement_counts_rates_and_what_joints_are_from_home_over_the_time_of_a_step():
    """Marcos et al. 2012, Eq. 17: ‖q̇‖² + ‖(q − q₀) / Δt‖² = (0.5² + 1) + (0.3² + 0.4²) / 0.2²."""
    motion = SimpleNamespace(q=np.array([[0.4, -0.2]]), dq=np.array([[0.5, -1.0]]))
    errors = np.zeros((1, 2))
    step = Step(motion=motion, home=np.array([0.1, 0.2]), position_error=errors, rotation_error=errors, dt=0.2)
    np.testing.assert_allclose(pk.joint_displacement.function(step), [1.25 + 0.25 / 0.04])
