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
    ("given", "said"), [(whole, "objective whole looks at a whole motion"), (abs, "objectives: wants")]
)
def test_objectives_of_whole_motions_and_plain_functions_are_refused(given, said):
    with pytest.raises(InvalidInput, match=said):
        as_step_objective(given)
