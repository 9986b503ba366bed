"""Attempts to dominate the points of a front: by IPOPT, and by random steps within all limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest
from paretoik.trajectory.derivatives import MotionLinearisation, linearise
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.tightening import violation_between
from studies.benchmarks.certified.cases import HOLDS, Subject, goal_row
from studies.reporting import Row

DOMINATED = 1e-7  # of the ranges
ROUNDING = 1e-13  # of the ranges: a smaller rise does not count
AGAIN = 3  # repeats below lower ceilings
SIZES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)  # rad (RMS) of random steps
KNOTS = (4, 8, 16, 32)  # of their splines
ROUNDS = 6  # of Newton's steps back within the limits


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """The result of an attempt on a point.

    ``gain`` is a share of the ranges, −inf without a result; ``ended`` says whether there is a motion, ``counts``
    whether it satisfies the path, the limits and the ceilings; ``distance`` [rad, RMS] is its distance from the point.
    """

    point: int
    how: str
    gain: float
    ended: bool
    counts: bool
    distance: float = np.nan


def ipopt_rows(subject: Subject, *, barriers: Sequence[str]) -> list[Row]:
    """Return the largest gain of IPOPT from any point, no objective rising; ``barriers``: "low", "high"."""
    tries = [
        ipopt_attempt(subject, point, main, warm=barrier == "low")
        for point in range(len(subject.q))
        for main in range(len(subject.ranges))
        for barrier in barriers
    ]
    ended, counts = sum(one.ended for one in tries), sum(one.counts for one in tries)
    note = f"{len(tries)} runs, {ended} ended well, {counts} of them within ceilings and limits"
    gain = max(0.0, *(one.gain for one in tries))
    return [
        goal_row(
            subject.name,
            "IPOPT from every point",
            "largest gain, no loss",
            "share of range",
            gain,
            DOMINATED,
            ", ".join([note, *_worst(tries)]),
        )
    ]


def ipopt_attempt(subject: Subject, point: int, main: int, *, warm: bool) -> Attempt:
    """Return IPOPT's gain when it minimises objective ``main`` below the point's own values of the others."""
    q, values, ranges = subject.q[point], subject.values[point], subject.ranges
    how = f"{subject.front.names[main]} minimised, barrier {'low' if warm else 'high'}"
    ceilings = np.where(np.arange(len(values)) == main, np.inf, values)
    for _ in range(AGAIN):
        end, _ = subject.peer.solve(q, main, ceilings, ranges, warm=warm)
        if end is None:
            return Attempt(point=point, how=how, gain=-np.inf, ended=False, counts=False)
        motion = led_back(subject.task, end)
        if motion is None or not keeps_limits(subject, point, motion):
            return Attempt(point=point, how=how, gain=-np.inf, ended=True, counts=False)
        rise = (objectives(subject.task, motion) - values) / ranges
        others = np.delete(rise, main)
        if others.max() <= ROUNDING:
            gain = float(-rise.min()) if rise.max() <= ROUNDING else -np.inf
            distance = float(joint_distance(subject.task, motion, q))
            return Attempt(point=point, how=how, gain=gain, ended=True, counts=True, distance=distance)
        ceilings = ceilings - 2 * np.maximum(rise, 0.0) * ranges
    return Attempt(point=point, how=how, gain=-np.inf, ended=True, counts=False)


def keeps_limits(subject: Subject, point: int, q: np.ndarray) -> bool:
    """Return whether a motion satisfies its limits, a spline between samples as well as a point of the front does."""
    task = subject.task
    if violation(task, q) > HOLDS:
        return False
    if task.differences != "spline":
        return True
    return violation_between(task, q) <= subject.certificates.violation_between[point] + HOLDS


def perturbation_rows(subject: Subject, *, steps: int, seed: int) -> list[Row]:
    """Return the largest gain in all objectives at once of random feasible steps from any point."""
    rng = np.random.default_rng(seed)
    tries = [one for point in range(len(subject.q)) for one in perturbations(subject, point, steps, rng)]
    note = f"{len(tries)} steps, {sum(one.counts for one in tries)} within limits"
    return [
        goal_row(
            subject.name,
            "random steps from every point",
            "largest gain of all",
            "share of range",
            max(one.gain for one in tries),
            DOMINATED,
            ", ".join([note, *_worst(tries)]),
        )
    ]


def perturbations(subject: Subject, point: int, steps: int, rng: np.random.Generator) -> list[Attempt]:
    """Return the gains of random smooth steps; every other one changes no objective to first order."""
    at = linearise(subject.program, subject.q[point])
    tries = []
    for k in range(steps):
        size, level = SIZES[k % len(SIZES)], bool(k // len(SIZES) % 2)
        how = f"a step of {size:g} rad" + (" that changes no objective to first order" if level else "")
        motion = within(at, random_step(at, size, rng), level=level)
        if motion is None:
            tries.append(Attempt(point=point, how=how, gain=-np.inf, ended=False, counts=False))
            continue
        gain = float(((subject.values[point] - objectives(subject.task, motion)) / subject.ranges).min())
        distance = float(joint_distance(subject.task, motion, subject.q[point]))
        tries.append(Attempt(point=point, how=how, gain=gain, ended=True, counts=True, distance=distance))
    return tries


def random_step(at: MotionLinearisation, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return a smooth random step of the self-motion, as unknowns, of a given length (RMS over time)."""
    samples, dof = at.x.shape
    knots = np.linspace(0.0, samples - 1.0, int(rng.choice(KNOTS)))
    smooth = CubicSpline(knots, rng.normal(size=(len(knots), dof)))(np.arange(samples))
    coordinates, place = np.einsum("tja,tj->ta", at.normal, smooth), at.program.stencil.first_unknown
    step, free = np.zeros(at.unknowns), place >= 0
    step[place[free, None] + np.arange(coordinates.shape[1])] = coordinates[free]
    moved = at.displacement(step)
    return step * (size / np.sqrt(np.mean(np.sum(moved**2, axis=1))))


def within(at: MotionLinearisation, step: np.ndarray, *, level: bool) -> np.ndarray | None:
    """Return the motion after a step, bent back within the limits; None if that fails."""
    task, short = at.program.task, np.zeros(at.elastic, dtype=bool)
    flat = at.gradients[: len(at.gradients) * level, : at.unknowns]  # a peak has no first order
    step = step - np.linalg.pinv(flat) @ (flat @ step) if level else step
    for _ in range(ROUNDS):
        motion = led_back(task, at.x + at.displacement(step))
        if motion is None:
            return None
        if violation(task, motion) <= HOLDS:
            return motion
        gaps = at.program.evaluate(motion)[2]
        short |= gaps < 0
        rows = np.concatenate([at.jacobian[np.flatnonzero(short)].toarray()[:, : at.unknowns], flat])
        step = step + np.linalg.lstsq(rows, np.concatenate([-gaps[short], np.zeros(len(flat))]))[0]
    return None


def led_back(task: MotionTask, q: np.ndarray) -> np.ndarray | None:
    """Return the motion (time, dof), its samples on the path within our own tolerance; None if it is lost."""
    retraction = retract_nearest(task.arm, task.tasks, q, task.targets)
    return np.asarray(retraction.q) if retraction.on_path.all() else None


def objectives(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return the objectives (n_obj,) of a motion, minimised."""
    motion = task.motion(q)
    return np.array([float(one(motion)) * one.sign for one in task.objectives])


def violation(task: MotionTask, q: np.ndarray) -> float:
    """Return the worst violation of a motion's limits, as a share of their ranges."""
    return float(task.violations(task.motion(q)).max(initial=0.0))


def _worst(tries: Sequence[Attempt]) -> list[str]:
    """Return the place of the largest gain in words, if there is one."""
    best = max(tries, key=lambda one: one.gain)
    if not best.gain > 0:
        return []
    return [
        f"{len({one.point for one in tries if one.gain > DOMINATED})} points beaten",
        f"most: point {best.point}, {best.how}, {best.distance:.1e} rad away",
    ]
