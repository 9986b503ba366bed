"""Motions: batches, quantities of the samples, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import Arm, Motion, Task, line
from paretoik.collision.obstacles import Sphere
from paretoik.errors import InvalidInput
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arms import tringali_3r

ARM = tringali_3r()
SPATIAL = Arm.from_dh(
    a=[0.0, 0.4, 0.3, 0.1],
    alpha=[1.5, 0.0, 0.7, 0.0],
    d=[0.3, 0.0, 0.1, 0.2],
    theta=[0.0] * 4,
    convention="standard",
    masses=[1.0, 2.0, 1.5, 0.5],
    centers=np.full((4, 3), 0.05),
    inertias=np.stack([0.01 * np.eye(3)] * 4),
)
RATES = ("dq", "ddq", "jerk")
PLACES = ("tool", "tool_rotation", "links")
SCORES = ("manipulability", "tracking_error", "clearance")


def even(samples):
    return np.linspace(0, 1, samples)


@pytest.mark.parametrize(("differences", "cyclic"), [("backward", True), ("central", False)])
def test_a_batch_is_its_motions_one_by_one(differences, cyclic):
    rng = np.random.default_rng(4)
    q = rng.normal(size=(3, 2, 12, 4))
    q[..., -1, :] = q[..., 0, :]
    time = np.cumsum(rng.uniform(0.1, 0.3, (3, 2, 12)), axis=-1)
    time = time - time[..., :1]
    ball = Sphere([0.2, 0.2, 0.3], 0.1)
    common = {"arm": SPATIAL, "differences": differences, "cyclic": cyclic, "obstacles": (ball,)}
    batch = Motion(q=q, time=time, **common)
    assert len(batch) == 3
    names = [*RATES, "torque", "power", "kinetic_energy", *PLACES, "clearance", "manipulability"]
    for i in range(3):
        for j in range(2):
            single = Motion(q=q[i, j], time=time[i, j], **common)
            for name in names:
                np.testing.assert_allclose(getattr(batch, name)[i, j], getattr(single, name), rtol=1e-12, atol=1e-12)
            for name in names:
                np.testing.assert_array_equal(getattr(batch[i], name)[j], getattr(batch, name)[i, j])


def test_a_batch_is_picked_from_by_number_slice_list_and_mask():
    motions = Motion(arm=ARM, time=even(5), q=np.random.default_rng(5).normal(size=(4, 5, 3)))
    mask = np.array([True, False, False, True])
    np.testing.assert_array_equal(motions[2].q, motions.q[2])
    np.testing.assert_array_equal(motions[1:3].q, motions.q[1:3])
    np.testing.assert_array_equal(motions[np.array([3, 0])].q, motions.q[[3, 0]])
    np.testing.assert_array_equal(motions[mask].q, motions.q[mask])
    assert [motion.q.shape for motion in motions] == [(5, 3)] * 4


def test_every_array_of_a_motion_is_read_only():
    path = line([0.4, 0.0], [0.2, 0.2], duration=1.0, samples=9)
    motions = Motion(
        arm=ARM,
        time=path.times,
        q=np.full((2, 9, 3), 0.5),
        tasks=(Task(path).resolve_axes(ARM),),
        obstacles=(Sphere([1, 0, 0], 0.1),),
    )
    names = ["q", "time", *RATES, "torque", "power", "kinetic_energy", *PLACES, *SCORES]
    for picked in (motions, motions[0], motions[np.array([1, 0])]):
        for name in names:
            with pytest.raises(ValueError, match="read-only"):
                getattr(picked, name)[...] = 0.0


def test_torque_power_and_energy_are_those_of_the_arm():
    motion = Motion(arm=SPATIAL, time=even(20), q=np.random.default_rng(7).normal(size=(20, 4)))
    torque = dynamics.inverse_dynamics(SPATIAL, motion.q, motion.dq, motion.ddq)
    np.testing.assert_array_equal(motion.torque, torque)
    np.testing.assert_array_equal(motion.power, torque * motion.dq)
    mass = dynamics.inertia_matrix(SPATIAL, motion.q)
    np.testing.assert_allclose(
        motion.kinetic_energy, 0.5 * np.einsum("ti,tij,tj->t", motion.dq, mass, motion.dq), rtol=1e-12
    )


def test_manipulability_is_that_of_the_tasks_or_of_the_tool():
    q = np.random.default_rng(9).normal(size=(7, 3))
    path = line([0.4, 0.0], [0.2, 0.2], duration=1.0, samples=7)
    by_hand = [np.sqrt(np.linalg.det(j[:2] @ j[:2].T)) for j in kinematics.jacobian(ARM, q)]
    for tasks in ((), (Task(path).resolve_axes(ARM),)):
        motion = Motion(arm=ARM, time=path.times, q=q, tasks=tasks)
        np.testing.assert_allclose(motion.manipulability, by_hand, rtol=1e-9)


def test_tracking_error_is_the_distance_to_the_path_in_its_worst_direction():
    path = line([0.4, 0.0], [0.2, 0.2], duration=1.0, samples=7)
    motion = Motion(
        arm=ARM, time=path.times, q=np.random.default_rng(10).normal(size=(7, 3)), tasks=(Task(path).resolve_axes(ARM),)
    )
    np.testing.assert_allclose(motion.tracking_error, np.abs(motion.tool - path.positions).max(axis=1), atol=1e-14)
    assert (Motion(arm=ARM, time=path.times, q=motion.q).tracking_error == 0).all()


POSTURES = np.zeros((5, 3))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"q": np.zeros((5, 4))}, r"q must have shape \(\.\.\., time, 3\), got \(5, 4\)"),
        ({"time": np.arange(4.0)}, r"one value per sample, at least 3, got shape \(4,\) for q of shape \(5, 3\)"),
        ({"q": np.where(np.arange(5)[:, None] == 3, np.nan, POSTURES)}, "every position must be .* at sample 3"),
        ({"time": np.array([0.0, 1.0, 1.0, 3.0, 0.5])}, "times must increase, got one that does not at sample 2"),
        ({"q": np.arange(15.0).reshape(5, 3), "cyclic": True}, "cyclic motion: must end where .* 12 rad or m"),
    ],
)
def test_what_is_no_motion_is_refused_in_one_line(changed, words, unchecked):
    with pytest.raises(InvalidInput, match=words) as refused:
        Motion(**{"arm": ARM, "time": np.arange(5.0), "q": POSTURES, **changed})
    assert "\n" not in str(refused.value)
