"""The problems of the package are as described, checked by independent means."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from problems import kim_2021, panda, tringali_2020

SMALL = {"population": 12, "generations": 2, "seed": 3}


@pytest.mark.parametrize("name", ["simulation_1", "simulation_2", "simulation_3", "simulation_4", "simulation_5"])
def test_each_simulation_is_built_with_the_limits_of_the_paper(name):
    problem = getattr(tringali_2020, name)()
    kinds = {"simulation_1": set(), "simulation_4": {"position", "velocity", "torque", "power"}}
    assert set(problem.task.bounds) == kinds.get(name, {"position", "velocity"})
    assert problem.task.cyclic == (name == "simulation_5")


def test_a_front_of_energy_torque_follows_the_line_within_limits_by_hand_written_kinematics():
    front = pk.solve(tringali_2020.energy_torque(), **SMALL)
    angles = np.cumsum(front.motions.q, axis=-1)
    lengths = np.array([0.176, 0.176, 0.1375])
    tool = np.stack([np.cos(angles) @ lengths, np.sin(angles) @ lengths], axis=-1)
    tau, omega = 0.5, 4 * np.pi
    t = np.linspace(0, 1, 101)
    rising = np.minimum(t, 1 - t)
    half = (rising**2 / 2 + (np.cos(omega * rising) - 1) / omega**2) / tau**2
    progress = np.where(t <= tau, half, 1 - half)
    line = np.array([0.4678, 0.0]) + progress[:, None] * np.array([0.0983 - 0.4678, 0.1526])
    assert np.abs(tool - line).max() < 1e-9
    assert np.abs(np.diff(front.motions.q, axis=1)).max() <= 3.8 * 0.01 * (1 + 1e-8)
    assert (np.abs(front.motions.q).max(axis=(0, 1)) <= np.deg2rad([90, 120, 120]) * (1 + 1e-8)).all()


def test_a_front_of_the_panda_is_confirmed_by_pinocchio():
    pinocchio = pytest.importorskip("pinocchio")
    front = pk.solve(panda.across_the_table(), **SMALL)
    model = pinocchio.buildModelFromUrdf(str(panda.URDF))
    data, tool = model.createData(), model.getFrameId("panda_hand_tcp")
    motion = front.motions[0]
    start, end = np.array([0.45, -0.25, 0.3]), np.array([0.45, 0.25, 0.3])
    down = np.diag([1.0, -1.0, -1.0])
    for q, dq, ddq, torque in zip(motion.q, motion.dq, motion.ddq, motion.torque, strict=True):
        full = [np.concatenate([values, np.zeros(2)]) for values in (q, dq, ddq)]
        pinocchio.framesForwardKinematics(model, data, full[0])
        place = data.oMf[tool]
        assert np.abs(np.cross(place.translation - start, end - start)).max() < 1e-9
        assert np.abs(place.rotation - down).max() < 1e-9
        expected = pinocchio.rnea(model, data, *full)[:7]
        assert np.abs(torque - expected).max() < 1e-10 * max(1.0, np.abs(expected).max())
    assert front.motions.tracking_error.max() < 1e-9


@pytest.mark.parametrize("name", ["directions_jam", "directions_dam", "point_to_point_jam", "point_to_point_dam"])
def test_motions_of_kims_problems_begin_and_end_where_the_paper_has_it(name):
    front = pk.solve(getattr(kim_2021, name)(), population=24, generations=8, seed=3)
    begin = kim_2021.START if name.startswith("point") else kim_2021.PLACE
    assert np.isfinite(front.objectives).all()
    assert np.abs(front.motions.tool[:, 0] - begin).max() < 1e-9
    assert np.abs(front.motions.tool[:, -1] - kim_2021.TARGET).max() < 1e-9
