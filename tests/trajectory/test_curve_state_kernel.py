"""A program's state of a motion is that of its curve, with exact first derivatives, also for rough motions."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.task.retraction import retract_nearest
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.tightening import hold_between, violation_between
from paretoik.trajectory.transcription import motion_program
from problems import panda

POSES = [pk.Pose.from_rpy((0.45, y, 0.4), panda.DOWN) for y in (-0.2, 0.2)]
CASES = {
    "cyclic": (pk.arms.tringali_3r(), pk.circle([0.25, 0.1], 0.05, duration=1.0, samples=31)),
    "position": (panda.panda(), pk.line([0.45, -0.2, 0.4], [0.45, 0.2, 0.5], duration=1.5, samples=31)),
    "axis": (panda.panda(), pk.Task(pk.line(*POSES, duration=1.5, samples=31), axes="xyz+z-axis")),
    "pose": (panda.panda(), pk.line(*POSES, duration=1.5, samples=31)),
}
cases = pytest.mark.parametrize("name", ["cyclic", "pose"])


def task_of(name, *objectives, **limits):
    arm, path = CASES[name]
    objectives = list(objectives) or [pk.kinetic_energy]
    limits = pk.Limits(torque=np.inf, **limits) if "torque" not in limits else pk.Limits(**limits)
    return pk.Tracking(arm, path, objectives=objectives, limits=limits, cyclic=name == "cyclic", bases=1).task


def rough(task, size, seed=0):
    """Return a motion with samples at random near a smooth one, also along the self-motion."""
    rng = np.random.default_rng(seed)
    q = sample_starts(task, 1, rng)[0]
    near = q + size * rng.normal(size=q.shape)
    near[-1] = near[0] if task.cyclic else near[-1]
    moved = retract_nearest(task.arm, task.tasks, near, task.targets)
    assert moved.on_path.all()
    if task.cyclic:
        moved.q[-1] = moved.q[0]
    return moved.q


@pytest.mark.parametrize("name", ["cyclic", "axis", "pose"])
@pytest.mark.parametrize("size", [0.0, 1e-2])
def test_objectives_of_a_program_are_those_of_the_motion(name, size):
    task = task_of(name, pk.kinetic_energy, pk.torque_norm, pk.peak_velocity, pk.jerk)
    q = rough(task, size)
    values = [float(objective(task.motion(q))) for objective in task.objectives]
    np.testing.assert_allclose(motion_program(task).evaluate(q)[0], values, rtol=1e-8)


@cases
def test_first_derivatives_are_exact(name):
    task = task_of(name, pk.kinetic_energy, pk.torque_norm)
    program, step = motion_program(task), 1e-6
    at = program.linearise(rough(task, 1e-3))
    direction = np.random.default_rng(1).normal(size=at.columns)
    ahead, back = (program.evaluate(at.retract(sign * step * direction))[0] for sign in (1, -1))
    np.testing.assert_allclose(at.gradients @ direction, (ahead - back) / (2 * step), rtol=1e-6)


@cases
def test_second_derivatives_are_those_along_the_path(name):
    task = task_of(name, pk.kinetic_energy, pk.torque_norm)
    program, step = motion_program(task), 1e-4
    at = program.linearise(rough(task, 1e-5))
    for k, weights in enumerate(np.eye(2)):
        hessian, direction = (
            at.hessian(weights, np.zeros(len(at.inequalities))),
            np.random.default_rng(1).normal(size=at.columns),
        )
        ahead, here, back = (program.evaluate(at.retract(sign * step * direction))[0][k] for sign in (1, 0, -1))
        bend = (ahead - 2 * here + back) / step**2
        assert direction @ (hessian @ direction) == pytest.approx(bend, rel=5e-3)


@cases
def test_torques_that_are_limited_are_those_of_the_curve(name):
    task = task_of(name, torque=1.0)
    q, program = rough(task, 1e-2), motion_program(task)
    values = program.evaluators.value(program.values(q).inputs)[program.sums :]
    rows = [program.rows.index(f"torque of {joint}") for joint in task.arm.joint_names]
    np.testing.assert_allclose(values[rows].T, task.motion(q).instants.torque, rtol=1e-8, atol=1e-8)


def test_a_held_motion_is_feasible_in_its_own_program_and_between_samples():
    arm, path = CASES["position"]
    free = pk.Tracking(arm, path, objectives=[pk.torque_norm]).task
    starts = sample_starts(free, 4, np.random.default_rng(0))
    best = free.motion(optimum(motion_program(free, [400.0]), starts, barrier=0.1))
    middle, half = (best.torque.max(axis=0) + best.torque.min(axis=0)) / 2, np.ptp(best.torque, axis=0) / 2
    half = np.maximum(0.93 * half, 0.05 * half.max())
    limits = pk.Limits(torque=(middle - half, middle + half))
    task = pk.Tracking(arm, path, objectives=[pk.torque_norm], limits=limits).task
    natural = motion_program(task, [400.0])
    spline = optimum(natural, best.q[None], barrier=1e-3)
    held = hold_between(natural, spline, 1)
    assert held.violation <= 1e-4 < violation_between(task, spline)
    assert held.program(natural).evaluate(held.x)[2].min() >= -1e-7


def optimum(program, starts, barrier):
    solutions = minimise(program, starts, np.ones((1, 1)), options=InteriorPointOptions(barrier=barrier))
    assert solutions.converged.any()
    return solutions.x[np.argmin(np.where(solutions.converged, solutions.objectives[:, 0], np.inf))]
