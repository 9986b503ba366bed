"""First postures: laws of planar and spatial arms, closed forms, and refusals."""

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot.kinematics import forward_kinematics
from problems import marcos_2012
from tests.closed_loop.planar_geometry import joints_of, meets
from tests.formulations.problems import panda

ARM = pk.arms.marcos_nr(3)
CIRCLE = marcos_2012.round_trip(0.7, 4)


@pk.objective(unit="N m", form="peak")
def holding_torque(motion):
    return np.abs(motion.torque).max(axis=-1)


def panda_pose():
    arm = panda()
    return arm, pose_of(arm, np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.4]))


def pose_of(arm, q):
    rotation, position = forward_kinematics(arm, q)
    return pk.Pose.from_matrix(rotation, position)


def test_solve_finds_a_posture_near_the_path_and_clear_of_obstacles():
    problem = marcos_2012.first_posture(3)
    front = pk.solve(problem, population=200, generations=60, stagnation=False, seed=1, observe=False)
    q = front.motions.q[0, 0]
    assert len(front) == 1
    assert front.names == ("position_error",)
    assert front.objectives[0, 0] == pytest.approx(abs(joints_of(q)[-1] - complex(*problem.task.targets[0])), abs=1e-12)
    assert front.objectives[0, 0] < 0.05
    assert not meets(q, problem.task.obstacles)
    np.testing.assert_array_equal(front.motions.q[0], np.tile(q, (3, 1)))
    assert pk.ClosedLoop(problem.task.arm, CIRCLE, start=q).start is not None


def test_the_error_of_a_pose_is_the_distance_and_the_angle():
    arm, pose = panda_pose()
    problem = pk.Posture(arm, pk.poses([0.0, 0.5, 1.0], [pose] * 3))
    assert problem.names == ("tool_error",)
    assert problem.units == ("m + rad",)
    q = np.random.default_rng(0).uniform(problem.xl, problem.xu, (20, arm.dof))
    F = problem.evaluate(q, return_values_of=["F"])[:, 0]
    for row, value in zip(q, F, strict=True):
        here = pose_of(arm, row)
        turned = here.rotation.T @ pose.rotation
        angle = np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))
        assert value == pytest.approx(np.linalg.norm(here.position - pose.position) + angle, rel=1e-9)


def test_torques_that_hold_the_arm_satisfy_their_limits():
    arm, pose = panda_pose()
    path = pk.line(pose.position, pose.position + np.array([0.1, 0.0, 0.0]), duration=1.0, samples=5)
    problem = pk.Posture(arm, path, limits=pk.Limits(torque=20.0), objectives=[holding_torque])
    front = pk.solve(problem, population=60, generations=30, seed=0, observe=False)
    q = front.genes
    assert np.abs(front.motions.torque[:, 0]).max() <= 20.0 * (1 + 1e-6)
    np.testing.assert_allclose(front.objectives[:, 1], np.abs(front.motions.torque[:, 0]).max(axis=1), rtol=1e-9)
    loads = np.abs(problem.decode(np.random.default_rng(0).uniform(problem.xl, problem.xu, (200, 7))).torque)[:, 0]
    assert (loads.max(axis=1) > 20.0).any()
    assert (q >= problem.xl).all()
    assert (q <= problem.xu).all()


NOT_OF_A_POSTURE = {
    "limits of a posture must be on position, torque and clearance, got vel": {"limits": pk.Limits(velocity=1.0)},
    "objectives must have names other than position_error": {
        "objectives": [pk.objective(unit="m", form="general", name="position_error")(np.sum)]
    },
    "path must be a Path": {"path": [0.7, 0.0]},
}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("words", NOT_OF_A_POSTURE)
def test_what_cannot_be_used_is_named(words):
    with pytest.raises(pk.InvalidInput, match=words):
        pk.Posture(**{"arm": ARM, "path": CIRCLE, **NOT_OF_A_POSTURE[words]})
