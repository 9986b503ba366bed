"""Nedungadi's motions: stationary kinetic energy, the planner's optima in continuous time, and refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from paretoik import Arm, Pose, Task, Tracking, kinetic_energy, line, plan
from paretoik.errors import Infeasible
from paretoik.robot import dynamics
from paretoik.robot.arms import tringali_3r
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import sample_postures
from paretoik.task.retraction import task_errors
from paretoik.task.self_motion import build_charts
from studies.tringali_2020.extremals import integrate_extremal
from tests.formulations.problems import panda
from tests.task.test_random_starts import task_of

FROM, TO = [0.4678, 0.0], [0.0983, 0.1526]  # m, the paper's line
BEST = (-0.387576, 0.516724, 0.195441)  # rad, near where the best optimum starts


def paper(samples=26, *, ends=(FROM, TO), arm=None, **changed) -> MotionTask:
    path = line(*ends, duration=1.0, samples=samples)
    return task_of(arm or tringali_3r("fitted"), path, objectives=[kinetic_energy], **changed)


def six_joints() -> Arm:
    rng = np.random.default_rng(3)
    return Arm.planar(
        lengths=[0.4] * 6, masses=rng.uniform(0.5, 2, 6), centers=[0.2] * 6, inertias=rng.uniform(0.01, 0.03, 6)
    )


def across(axes, samples=31) -> MotionTask:
    ends = [Pose.from_rpy((0.45, y, 0.3 + y / 3), (3.1, 0.8 * y, y)) for y in (-0.1, 0.1)]
    return task_of(panda(), Task(line(*ends, duration=1.0, samples=samples), axes=axes))


def two_tasks() -> MotionTask:
    elbow = Task(line([0.6, 0.4], [0.7, 0.5], duration=1.0, samples=31), frame="joint4")
    tool = Task(line([1.2, 0.2], [1.3, 0.6], duration=1.0, samples=31))
    return task_of(six_joints(), [elbow, tool])


def turning() -> MotionTask:
    return task_of(six_joints(), line(Pose.planar(1.2, 0.4, 0.5), Pose.planar(1.0, 0.8, 1.5), duration=1.0, samples=31))


TASKS = {
    "3R": paper,
    "6R with its angle": turning,
    "6R, elbow and tool": two_tasks,
    "Panda, position": lambda: across("xyz"),
    "Panda, position and axis": lambda: across("xyz+z-axis"),
    "Panda, pose": lambda: across("pose"),
}


def posture(task, count=1, seed=4):
    """Return well-conditioned postures at sample 0."""
    q = sample_postures(task, 40, np.random.default_rng(seed))
    jacobian = task_errors(task.arm, task.tasks, q, task.targets[0])[1]
    return q[np.argsort(np.linalg.cond(jacobian), kind="stable")[:count]]


def driving(extremal):
    """Return the torques (time, redundancy) that drive the self-motion, relative to all torques."""
    motion, arm = extremal.motion, extremal.motion.arm.mounted(gravity=(0.0, 0.0, 0.0))
    bend = CubicSpline(motion.time, extremal.dq, axis=-2).derivative()(motion.time)
    torque = dynamics.inverse_dynamics(arm, motion.q, extremal.dq, bend)
    task = task_of(motion.arm, list(motion.tasks))
    normal = build_charts(task, motion.q[None]).null_space[0]
    return np.einsum("td,tdr->tr", torque, normal)[2:-2] / np.abs(torque).max()


def smooth_energy(motion):
    """Return the kinetic energy integral of the cubic spline through a motion's samples."""
    dq = CubicSpline(motion.time[0], motion.q, axis=-2).derivative()(motion.time[0])
    return CubicSpline(motion.time[0], dynamics.kinetic_energy(motion.arm, motion.q, dq), axis=-1).integrate(0, 1)


@cache
def best(samples=26, tolerance=1e-7):
    return integrate_extremal(paper(samples), np.array(BEST), tolerance=tolerance)


@pytest.mark.parametrize("make", TASKS.values(), ids=TASKS.keys())
def test_no_torque_drives_the_self_motion(make):
    task = make()
    extremal = integrate_extremal(task, posture(task)[0], tolerance=1e-7)
    assert np.abs(driving(extremal)).max() < 3e-4
    assert extremal.motion.tracking_error.max() < 1e-9


def test_a_torque_drives_it_with_the_sign_as_printed():
    extremal = integrate_extremal(paper(), np.array(BEST), tolerance=1e-6, as_printed=True)
    assert np.abs(driving(extremal)).max() > 0.03
    assert extremal.energy > 2 * best().energy


@pytest.mark.parametrize("as_printed", [False, True])
def test_the_energy_is_stationary_and_least_but_not_with_the_sign_as_printed(as_printed):
    task = paper(51)
    base = integrate_extremal(task, np.array(BEST), tolerance=1e-7, as_printed=as_printed).motion.q[None]
    for shape in (1, 2, 3):
        y = 1e-3 * np.array([-1.0, 0.0, 1.0])[:, None, None] * np.sin(shape * np.pi * task.times)[:, None] ** 2
        q, on_path = build_charts(task, base).at(task, np.zeros(3, dtype=int), y)
        assert on_path.all()
        energy = smooth_energy(task.motion(q))
        slope = (energy[2] - energy[0]) / 2e-3
        assert abs(slope) > 1e-3 if as_printed else abs(slope) < 1e-5
        assert (energy[1] < min(energy[0], energy[2])) == (not as_printed)


def test_the_planner_s_optimum_comes_nearer_as_its_steps_are_halved():
    apart, differ = [], []
    for samples in (26, 51):
        path = line(FROM, TO, duration=1.0, samples=samples)
        planned = plan(
            Tracking(tringali_3r("fitted"), path, objectives=[kinetic_energy], differences="backward"), starts=12
        ).best
        extremal = integrate_extremal(paper(samples), planned.motion.q[0], tolerance=1e-7)
        apart.append(np.abs(extremal.motion.q - planned.motion.q).mean())
        differ.append(float(kinetic_energy(extremal.motion) - planned.objective))
    assert 1.7 < apart[0] / apart[1] < 2.4
    assert differ[0] > 2 * differ[1] > 0  # the planner's motion is optimal for its discretisation
    assert abs(planned.objective - extremal.energy) < 5e-3 * extremal.energy


def gantry() -> Arm:
    """Return three sliding joints that move one point in a plane: inertia and Jacobian never change."""
    slide = ["prismatic"] * 4
    return Arm.from_dh(
        a=[0.0] * 4,
        alpha=[0.0, np.pi / 2, -np.pi / 2, np.pi / 3],
        d=[0.0] * 4,
        theta=[0.0, 0.4, 0.9, 0.3],
        convention="modified",
        types=slide,
        masses=[1.0, 2.0, 0.7, 0.4],
        inertias=np.tile(0.1 * np.eye(3), (4, 1, 1)),
    )


def test_a_gantry_moves_in_proportion_to_its_path():
    arm = gantry()
    path = line([0.0, 0.0, 0.0], [0.3, -0.2, 0.1], duration=1.0, samples=21)
    task = task_of(arm, path, objectives=[kinetic_energy])
    rates = np.array([0.3, -0.1, 0.2, 0.4])
    jacobian = task_errors(arm, task.tasks, np.zeros(4), task.targets[0])[1]
    drift = rates - np.linalg.pinv(jacobian) @ jacobian @ rates
    inertia = dynamics.inertia_matrix(arm, np.zeros(4))
    spread = np.linalg.solve(inertia, jacobian.T)
    weighted = spread @ np.linalg.inv(jacobian @ spread)
    extremal = integrate_extremal(task, np.zeros(4), rates=drift)
    expected = (path.positions - path.positions[0]) @ weighted.T + task.times[:, None] * drift
    np.testing.assert_allclose(extremal.motion.q, expected, atol=1e-8)


def test_a_motion_run_backwards_is_a_motion_of_the_path_run_backwards():
    there = best(51, 1e-8)
    back = integrate_extremal(paper(ends=(TO, FROM)), there.motion.q[-1], rates=-there.dq[-1], tolerance=1e-8)
    np.testing.assert_allclose(back.motion.q[::-1], there.motion.q[::2], atol=1e-5)
    np.testing.assert_allclose(back.dq[::-1], -there.dq[::2], atol=1e-4)


def test_gravity_plays_no_part_and_a_start_of_the_task_s_own_is_taken():
    hung = tringali_3r("fitted").mounted(gravity=(0.0, -9.81, 0.0))
    extremal = integrate_extremal(paper(arm=hung, start=best().motion.q[0]), tolerance=1e-7)
    np.testing.assert_allclose(extremal.motion.q, best().motion.q, atol=1e-9)


def test_a_motion_into_a_singularity_is_refused_with_sample_and_time():
    ends = ([0.3, 0.1], [0.6, 0.1])
    task = paper(21, ends=ends)
    beyond = np.linalg.norm(task.targets, axis=1) > 0.4895
    q = posture(task, 2)
    with pytest.raises(Infeasible, match=f"motion 0 runs into a singularity past sample {np.argmax(beyond) - 1} "):
        integrate_extremal(task, q, tolerance=1e-5)
    stretched = paper(21, ends=([0.4895, 0.0], [0.3, 0.1]))
    with pytest.raises(Infeasible, match="motion 0 runs into a singularity past sample 0 "):
        integrate_extremal(stretched, np.zeros(3), tolerance=1e-5)
