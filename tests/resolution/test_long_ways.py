"""Laws of ``resolve`` for large errors, sliding joints, and joints with only one limit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paretoik as pk
from paretoik import Limits, Pose, line
from paretoik.errors import Infeasible
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r, wan_7r

START = np.array([0.0, 0.327, -0.754])
BENT = np.array([0.3, -0.4, 0.5, -0.9, 0.4, 0.7, -0.3])
DOWN = line([0.468, 0.0], [0.368, 0.0], duration=1.0, samples=101)
METHODS = [
    pk.methods.PseudoInverse(),
    pk.methods.DampedLeastSquares(),
    pk.methods.WeightedLeastNorm(),
    pk.methods.WeightedGradientProjection(),
    pk.methods.PredictiveKineticEnergy(feedback=50.0),
]
every_method = pytest.mark.parametrize("method", METHODS, ids=lambda one: type(one).__name__)


@pytest.mark.filterwarnings("ignore:waypoints")  # there and back, the curve overshoots
@every_method
@pytest.mark.parametrize("farthest", [0.7])
def test_a_motion_that_loses_a_path_out_of_reach_finds_it_again(method, farthest):
    corners = [[0.4678, 0.0], [farthest, 0.0], [0.4678, 0.0], [0.4, 0.05]]
    path = pk.waypoints(corners, duration=1.0, samples=201)
    motion = pk.resolve(tringali_3r(), path, method, start=START, unreachable="track")
    assert motion.tracking_error.max() > 0.9 * (farthest - 0.49)
    assert motion.tracking_error[-1] < 1e-4
    assert np.abs(np.diff(motion.q, axis=0)).max() <= 1.0 + 1e-12
    assert np.abs(motion.q).max() < np.pi  # it did not spin in between


@every_method
def test_a_step_too_long_is_shortened_in_all_its_parts_or_refused(method):
    path = pk.waypoints([[0.4678, 0.0], [0.7, 0.0], [0.4, 0.05]], duration=1.0, samples=101)
    motion = pk.resolve(tringali_3r(), path, method, start=START, unreachable="track")
    traces, short = motion.traces, motion.traces.status == "shortened"
    assert short.any()
    assert np.abs(traces.velocities[short] * 0.01).max(axis=1) == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(Infeasible, match=r"off the path at sample|more than 1 rad or m in the step at sample"):
        pk.resolve(tringali_3r(), path, method, start=START)


def turned(arm, q, about, angle):
    """Return a path from a posture's place whose first orientation differs from the posture's by an angle."""
    rotation, position = kinematics.forward_kinematics(arm, q)
    off = rotation @ Rotation.from_rotvec(angle * np.array(about) / np.linalg.norm(about)).as_matrix()
    first = Pose.from_matrix(off, position)
    last = Pose.from_rpy((0.05, -0.05, 0.05), (0.3, 0.2, -0.4)) @ first
    return line(first, last, duration=1.0, samples=1001)


@pytest.mark.parametrize("angle", [1.0, np.pi])
def test_a_large_error_of_orientation_is_made_good(angle):
    arm = wan_7r()
    path = turned(arm, BENT, (1.0, -2.0, 0.5), angle)
    motion = pk.resolve(arm, path, pk.methods.PseudoInverse(feedback=10.0), start=BENT, unreachable="track")
    sizes = np.linalg.norm(motion.traces.errors[:, 3:], axis=1)
    decayed = angle * (1.0 - 10.0 * 0.001) ** np.arange(1001)
    assert sizes[:601] == pytest.approx(decayed[:601], rel=0.05)  # later it meets the limit of its reach
    assert np.linalg.norm(motion.traces.errors[:601, :3], axis=1).max() < 0.01


def test_sliding_joints_are_resolved_as_turning_ones_are():
    arm = pk.Arm.from_dh(
        theta=[0.0] * 7,
        alpha=[np.pi / 2, 0.0, np.pi / 2, -np.pi / 2, np.pi / 2, -np.pi / 2, 0.0],
        a=[0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0],
        d=[0.2, 0.0, 0.3, 0.0, 0.3, 0.0, 0.1],
        types=["revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute", "revolute"],
        convention="standard",
    )
    rotation, position = kinematics.forward_kinematics(arm, BENT)
    first = Pose.from_matrix(rotation, position)
    last = Pose.from_rpy((0.1, -0.05, 0.05), (0.1, 0.0, 0.2)) @ first
    path = line(first, last, duration=1.0, samples=401)
    motion = pk.resolve(arm, pk.Task(path, axes="xyz+z-axis"), pk.methods.PseudoInverse(), start=BENT)
    assert motion.tracking_error.max() < 1e-4
    assert np.abs(motion.traces.velocities[:, [1, 4]]).min() > 0
    assert motion.traces.errors.shape == (401, 5)
    half = pk.resolve(arm, pk.Task(path.resample(201), axes="xyz+z-axis"), pk.methods.PseudoInverse(), start=BENT)
    assert half.q[-1] == pytest.approx(motion.q[-1], abs=5e-3)  # both go the same way


@pytest.mark.parametrize("side", ["upper", "lower"])
@pytest.mark.parametrize(
    "method", [pk.methods.WeightedLeastNorm(), pk.methods.WeightedGradientProjection()], ids=["WLN", "WGPM"]
)
def test_a_joint_with_one_limit_is_kept_from_it_as_with_a_turn_between_two(method, side):
    upper, lower = np.array([0.35, 1.2, -0.5]), np.array([-0.3, 0.1, -1.9])
    one = (np.full(3, -np.inf), upper) if side == "upper" else (lower, np.full(3, np.inf))
    two = (upper - 2 * np.pi, upper) if side == "upper" else (lower, lower + 2 * np.pi)
    alone, both = (
        pk.resolve(tringali_3r(), DOWN, method, start=START, limits=Limits(position=each), unreachable="track")
        for each in (one, two)
    )
    assert (both.traces.weights != 1.0).any()
    np.testing.assert_allclose(alone.q, both.q, rtol=0, atol=1e-12)
