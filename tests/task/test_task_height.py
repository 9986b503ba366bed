"""Arms in space follow 2-D points if their frame keeps its height, up to rounded angles of a URDF."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import Arm, Pose, Task, line
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import characteristic_length
from paretoik.task.retraction import retract_nearest
from tests.robot.urdf_text import joint, link

POINTS_2D = line([0.3, 0.2], [0.1, 0.4], duration=1.0, samples=5)


def gantry(tmp_path, slope=1.5708):
    """Return a planar arm on a rail along x; the z axes of its links are along x up to the rounding of ``slope``."""
    links = [link(name) for name in ("rail", "cart", "upper", "fore", "hand")]
    bounds = '<limit lower="-9" upper="9" velocity="3" effort="4"/>'
    joints = [
        joint("slide", "rail", "cart", "prismatic", f'<origin rpy="0 {slope} 0"/><axis xyz="0 0 1"/>{bounds}'),
        joint("turn", "cart", "upper", "revolute", f'<axis xyz="-1 0 0"/>{bounds}'),
        joint("bend", "upper", "fore", "revolute", f'<origin xyz="0 0 0.4"/><axis xyz="-1 0 0"/>{bounds}'),
        joint("grip", "fore", "hand", "fixed", '<origin xyz="0 0 0.3"/>'),
    ]
    file = tmp_path / "gantry.urdf"
    file.write_text(f'<robot name="gantry">{"".join([*links, *joints])}</robot>', encoding="utf-8")
    return Arm.from_urdf(file)


def test_a_gantry_of_rounded_angles_follows_2d_points_and_keeps_its_height(tmp_path):
    arm = gantry(tmp_path)
    task = Task(POINTS_2D).resolve_axes(arm)
    assert task.axes == "xy"
    times, length = np.linspace(0.0, 1.0, 21), characteristic_length(arm)
    targets = task.targets(times)
    q = np.repeat([[0.1, 0.4, 0.5]], len(times), axis=0)
    retracted = retract_nearest(arm, [task], q, targets)
    assert retracted.on_path.all()
    position = arm.pose(retracted.q).position
    np.testing.assert_allclose(position[:, :2], targets, rtol=0.0, atol=1e-12 * length)
    np.testing.assert_allclose(position[:, 2], 0.0, rtol=0.0, atol=1e-4 * length)
    assert np.abs(position[:, 2]).max() > 0.0


@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (1e3, 0.0, 0.0)])
def test_a_frame_that_rises_by_more_than_rounded_angles_do_is_refused_wherever_it_stands(tmp_path, base):
    arm = gantry(tmp_path, slope=1.57).mounted(base=Pose(base))
    with pytest.raises(InvalidInput, match="path must have 3-D points"):
        Task(POINTS_2D).resolve_axes(arm)
