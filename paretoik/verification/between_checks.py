"""Motions between their samples: the curve, projected onto the path, its limits, and what it comes near to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.interpolant import rebuild
from paretoik.verification.measured_motion import MeasuredMotion
from paretoik.verification.motion_limits import clearance_range, limit_excess
from paretoik.verification.obstacle_distances import clearances, smallest_radius
from paretoik.verification.options import OPTIONS
from paretoik.verification.path_targets import path_points, task_error
from paretoik.verification.report import Check, judge, leave_out, note

STENCIL = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0, np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0


def project(model: ArmModel, tasks: Any, q: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return postures moved onto the path along the normal directions, and how far they are off it then."""
    targets = [path_points(task.path, t) for task in tasks]
    result, error = np.array(q), np.zeros(len(t))
    squares = model.scales**2
    for row in range(len(t)):
        directions = None
        for _ in range(OPTIONS.newton_steps):
            parts = [
                task_error(model, task, result[row], x[row], None if turned is None else turned[row])
                for task, (x, turned) in zip(tasks, targets, strict=True)
            ]
            miss, jacobian = np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
            if directions is None:
                directions = squares[:, None] * jacobian.T
            error[row] = np.abs(miss).max()
            if error[row] < 1e-13:
                break
            step = np.linalg.lstsq(jacobian @ directions, miss, rcond=None)[0]
            result[row] = result[row] + directions @ step
    return result, error


def check_between(
    task: Any,
    model: ArmModel,
    samples: MeasuredMotion,
    time: np.ndarray,
    q: np.ndarray,
    stated: float | None,
    point: int,
) -> Iterator[Check]:
    """Check one motion between its samples; ``stated`` is the violation there that the table admits, if any."""
    options = {"differences": task.differences, "cyclic": task.cyclic, "ends_at_rest": task.ends_at_rest}
    curve = rebuild(time, q, **options)
    t = (time[:-1, None] + np.diff(time)[:, None] * np.arange(1, 4) / 4).ravel()
    on_path, error = project(model, task.tasks, curve(t), t)
    at = f"it leaves its path by {error.max():.3g} at {t[int(error.argmax())]:.4g} s"
    yield judge("tracking between samples", float(error.max()), OPTIONS.on_path, at, point=point)
    if task.bounds:
        yield from _check_limits(task, model, curve, time, t, on_path, stated, point)
    if task.obstacles:
        yield from _check_clearance(task, model, curve, samples, time, stated, point)


def _check_limits(
    task: Any,
    model: ArmModel,
    curve: Any,
    time: np.ndarray,
    t: np.ndarray,
    q: np.ndarray,
    stated: float | None,
    point: int,
) -> Iterator[Check]:
    step = np.repeat(np.diff(time), 3) * OPTIONS.reach
    shifted = [project(model, task.tasks, curve(t + k * step), t + k * step)[0] for k in (-2, -1, 1, 2)]
    stack = np.stack([shifted[0], shifted[1], q, shifted[2], shifted[3]])
    dq = np.tensordot(STENCIL[0], stack, axes=1) / step[:, None]
    ddq = np.tensordot(STENCIL[1], stack, axes=1) / step[:, None] ** 2
    motion = MeasuredMotion(
        model=model, task=task, time=t[None], q=q[None], dq=dq[None], ddq=ddq[None], jerk=0 * ddq[None], weights=0 * t
    )
    worst = limit_excess(task, motion)
    kind = max(worst, key=lambda each: worst[each][0])
    excess, where = max(worst[kind][0], 0.0), worst[kind][1]
    subject = "limits between samples"
    if stated is None:
        yield note(subject, excess, f"{where}; nothing is promised between samples of a point not refined", point=point)
    elif task.differences != "spline":
        yield note(subject, excess, f"{where}; differences={task.differences!r} promise nothing there", point=point)
    else:
        detail = f"{where} is exceeded by {excess:.3g} of its range, the table admits {stated:.3g}"
        yield judge(subject, excess, stated + OPTIONS.between, detail, point=point)


def _check_clearance(
    task: Any, model: ArmModel, curve: Any, samples: MeasuredMotion, time: np.ndarray, stated: float | None, point: int
) -> Iterator[Check]:
    """Check distances all the way: an interval is done with where its ends and its length exclude a collision."""

    def postures(t: np.ndarray) -> np.ndarray:
        return project(model, task.tasks, curve(t), t)[0]

    smallest, at, proven = least_clearance(task, model, postures, samples, time)
    size, short = clearance_range(task, model), max(float(task.min_clearance) - smallest, 0.0)
    detail = f"links come within {smallest:.4g} m of an obstacle at {at:.4g} s, {task.min_clearance:g} m wanted"
    accepted = (stated + OPTIONS.between) * size if stated is not None else _grazing(task, samples, time)
    yield judge("clearance between samples", short, accepted, detail, point=point)
    if not proven:
        yield leave_out("clearance between samples", "an interval is too near to an obstacle to be sure", point=point)


def least_clearance(
    task: Any, model: ArmModel, postures: Callable[[np.ndarray], np.ndarray], samples: MeasuredMotion, time: np.ndarray
) -> tuple[float, float, bool]:
    """Return the least clearance where it may be below the limit, its time, and whether nothing hides between."""
    count = OPTIONS.instants
    t = np.append((time[:-1, None] + np.diff(time)[:, None] * np.arange(count) / count).ravel(), time[-1])
    q = postures(t)
    distance = clearances(task.obstacles, model.nodes(q), samples.link_radius)
    reaches = model.reaches(q)
    speed = 1.5 * np.abs(np.diff(q, axis=0)) / np.diff(t)[:, None] + 0.05 * np.abs(samples.dq[0]).max(axis=0)
    ends, rate = np.stack([t[:-1], t[1:]], axis=1), speed @ reaches
    near = np.stack([distance[:-1], distance[1:]], axis=1)
    smallest, at = float(distance.min()), float(t[int(distance.argmin())])
    limit = float(task.min_clearance)
    for _ in range(OPTIONS.bisections):
        open_ = near.sum(axis=1) - rate * np.diff(ends, axis=1)[:, 0] < 2 * min(limit, smallest)
        if not open_.any():
            return smallest, at, True
        ends, near, rate = ends[open_], near[open_], rate[open_]
        middle = ends.mean(axis=1)
        distance = clearances(task.obstacles, model.nodes(postures(middle)), samples.link_radius)
        if distance.min() < smallest:
            smallest, at = float(distance.min()), float(middle[int(distance.argmin())])
        ends = np.concatenate([np.stack([ends[:, 0], middle], 1), np.stack([middle, ends[:, 1]], 1)])
        near = np.concatenate([np.stack([near[:, 0], distance], 1), np.stack([distance, near[:, 1]], 1)])
        rate = np.concatenate([rate, rate])
        keep = near.sum(axis=1) - rate * np.diff(ends, axis=1)[:, 0] < 2 * min(limit, smallest)
        order = np.argsort(near.min(axis=1))[:400]
        chosen = np.intersect1d(np.flatnonzero(keep), order)
        ends, near, rate = ends[chosen], near[chosen], rate[chosen]
        if not len(ends):
            return smallest, at, True
    resolved = float((rate * np.diff(ends, axis=1)[:, 0]).max()) <= 1e-3 * model.length
    return smallest, at, resolved


def _grazing(task: Any, samples: MeasuredMotion, time: np.ndarray) -> float:
    """Return how deep [m] links may dip between samples that are clear, on their way along an obstacle.

    Half an interval h of speed v along a round of radius R dips v²h²/8R, one of acceleration a, a h²/8; never as deep
    as half the smallest obstacle, which would be through it.
    """
    round_ = smallest_radius(task.obstacles)
    nodes = samples.links[0]
    step = np.diff(samples.time[0])
    v = np.linalg.norm(np.diff(nodes, axis=0), axis=-1).max(axis=1) / step
    a = np.linalg.norm(np.diff(nodes, 2, axis=0), axis=-1).max(initial=0.0) / step.min() ** 2
    dip = np.diff(time).max() ** 2 / 8 * (a + v.max() ** 2 / (round_ + samples.link_radius))
    return float(min(dip, round_ / 2))
