import numpy as np
import pytest

import paretoik as pk
from problems import tringali_2020
from tests.pareto.motions import certify_motions

SLOW = [pytest.param(f"simulation_{i}", marks=pytest.mark.slow) for i in (1, 3, 4)]


@pytest.mark.parametrize("name", ["simulation_2", "simulation_5", *SLOW])
def test_planned_optima_are_certified_minima(name):
    problem = getattr(tringali_2020, name)()
    planned = pk.plan(problem, starts=12)
    certificate = certify_motions(
        problem.task, np.stack([o.motion.q for o in planned.optima]), np.array([planned.best.objective])
    )
    assert certificate.criticality.max() <= 1e-6
    assert certificate.violation.max() <= 1e-8
    assert set(certificate.status) == {"minimum"}


def test_a_kink_that_keeps_a_motion_from_being_certified_is_named():
    path, arm = tringali_2020.straight(11), pk.arms.tringali_3r()
    plain = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], bases=1, differences="backward")
    q = np.array(plain.decode(np.atleast_2d((plain.xl + plain.xu) / 2)).q)
    ends = np.abs(q[0, 5, 1]), 2.0 * np.abs(q).max()  # reached by the joint at a sample, and never
    for end, named in zip(ends, (True, False), strict=True):

        def saturated(motion, end=end):
            return np.clip(motion.q[..., 1], -end, end) ** 2

        effort = pk.objective(unit="rad²s", form="integral", maximise=True)(saturated)
        task = pk.Tracking(arm, path, objectives=[effort], bases=1, differences="backward").task
        (reason,) = certify_motions(task, q, np.ones(1)).reason
        assert ("on one side of a kink of saturated" in reason) == named
        assert reason.startswith("criticality")
