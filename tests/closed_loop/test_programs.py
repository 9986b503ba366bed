import pytest

import paretoik as pk
from paretoik.closed_loop.objectives import Step, step_objective
from paretoik.errors import InvalidInput
from problems import marcos_2012
from tests.closed_loop.postures import posture


def test_an_objective_that_looks_at_other_samples_is_named():
    @step_objective(unit="rad")
    def mean(step: Step):
        return step.motion.q[..., 0].mean(axis=-1)

    loop = pk.ClosedLoop(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 4), objectives=[mean], start=posture(3))
    with pytest.raises(InvalidInput, match="objective mean"):
        loop.step_evolution()
