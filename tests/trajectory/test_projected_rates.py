"""Torques that the path allows are those of the projected curve, where those of the spline are not."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.task.between import OPTIONS, finer_motion
from paretoik.task.retraction import retract_nearest
from paretoik.trajectory.functions import ON_PATH
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.tightening import hold_between, violation_between
from paretoik.trajectory.transcription import motion_program
from problems import panda

POSES = [pk.Pose.from_rpy((0.45, y, 0.4), panda.DOWN) for y in (-0.2, 0.2)]
CASES = {
    "planar": (pk.arms.tringali_3r(), pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=31)),
    "cyclic": (pk.arms.tringali_3r(), pk.circle([0.25, 0.1], 0.05, duration=1.0, samples=31)),
    "position": (panda.panda(), pk.line([0.45, -0.2, 0.4], [0.45, 0.2, 0.5], duration=1.5, samples=31)),
    "pose": (panda.panda(), pk.line(*POSES, duration=1.5, samples=31)),
}


def limited(name, torque=1.0):
    arm, path = CASES[name]
    limits = pk.Limits(torque=torque)
    return pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=limits, cyclic=name == "cyclic").task


def zigzag(task, size=0.01):
    """Return a motion whose samples lie on alternate sides of a smooth one, along the self-motion too."""
    rng = np.random.default_rng(0)
    q = sample_starts(task, 1, rng)[0]
    sides = np.where(np.arange(len(q)) % 2, size, -size)[:, None]
    sides[-1] = sides[0] if task.cyclic else sides[-1]
    moved = retract_nearest(task.arm, task.tasks, q + sides * rng.normal(size=q.shape[1]), task.targets)
    assert moved.on_path.all()
    return moved.q


def torques(program, q, suffix=""):
    """Return the torques (instants, dof) that a program limits."""
    inputs = program.values(q).inputs
    values = program.evaluators.value(inputs)[program.sums :]
    return values[[program.rows.index(f"torque of {joint}{suffix}") for joint in program.task.arm.joint_names]].T


@pytest.mark.parametrize("name", CASES)
def test_torques_on_the_path_are_those_of_the_projected_curve(name):
    task = limited(name)
    q = zigzag(task)
    program = motion_program(task, near=q)
    curve = finer_motion(task.motion(q)).torque[:: OPTIONS.steps // task.stride]
    off = np.abs(torques(program, q) - curve)
    remaining = np.abs(torques(program, q, ON_PATH) - curve)
    assert np.median(remaining) <= 0.05 * np.median(off)
    assert remaining.max() <= 0.2 * off.max()


@pytest.mark.parametrize("name", CASES)
def test_limits_on_the_path_come_last_and_change_none_of_the_others(name):
    task = limited(name)
    plain, program = motion_program(task), motion_program(task, near=zigzag(task))
    assert program.inequality_names[: plain.elastic] == plain.inequality_names
    assert all(limit.endswith(ON_PATH) for limit in program.inequality_names[plain.elastic :])
    np.testing.assert_array_equal(program.bounds[: plain.elastic], plain.bounds[: plain.elastic])


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
    assert held.violation == 0.0 < 1e-4 < violation_between(task, spline)
    assert held.program(natural).evaluate(held.x)[2].min() >= -1e-7


def optimum(program, starts, barrier):
    solutions = minimise(program, starts, np.ones((1, 1)), options=InteriorPointOptions(barrier=barrier))
    assert solutions.converged.any()
    return solutions.x[np.argmin(np.where(solutions.converged, solutions.objectives[:, 0], np.inf))]
