from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.verification.arm_model import build_model
from paretoik.verification.motion_checks import finer_motion, project_curve
from paretoik.verification.tolerances import OPTIONS

ARM = pk.arms.tringali_3r()
PATHS = {
    "line": pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=12),
    "waypoints": pk.waypoints([[0.4, 0.0], [0.35, 0.1], [0.25, 0.1], [0.2, 0.2]], duration=1.0, samples=12),
    "circle": pk.circle([0.3, 0.05], 0.08, duration=1.5, samples=12),
}


@pytest.mark.parametrize("differences", ["spline", "backward"])
@pytest.mark.parametrize("name", PATHS)
def test_a_projected_curve_and_its_rates_are_those_of_the_motion(name, differences):
    options = {"objectives": [pk.kinetic_energy], "differences": differences, "cyclic": name == "circle"}
    problem = pk.Tracking(ARM, PATHS[name], coefficients=4, bases=2, **options)
    task = problem.task
    motion = task.motion(problem.encoding.charts.base[0])
    curve = project_curve(task, build_model(ARM), task.times, motion.q)
    t = np.linspace(0.0, task.times[-1], 203)[1:-1]
    for order, (values, tolerance) in enumerate(zip(motion.state(t), (1e-9, 1e-6, 1e-3), strict=True)):
        np.testing.assert_allclose(curve(t, order), values, atol=tolerance * max(np.abs(values).max(), 1.0))
    finer = finer_motion(task, build_model(ARM), curve, task.times)
    assert finer.time.shape[1] == OPTIONS.finer * (len(task.times) - 1) + 1
    np.testing.assert_allclose(finer.integral(np.ones_like(finer.time)), task.times[-1])
    np.testing.assert_allclose(finer.integral(finer.time**3), task.times[-1] ** 4 / 4)
