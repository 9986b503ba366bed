"""Numbers of a method that were searched for: what the table may say, by the one motion of each point that is stored.

The table has the worst, or the mean, of motions from several starts; of these the first is stored. Nothing here follows
a path by the method a second time, so that a worst value is bounded by the stored motion's, from one side.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.library_objectives import objective_value
from paretoik.verification.measured_motion import MeasuredMotion, measure
from paretoik.verification.motion_checks import check_path
from paretoik.verification.options import TOLERANCES
from paretoik.verification.path_targets import orientation_errors, sample_points, task_axes
from paretoik.verification.report import Check, demand, judge, leave_out
from paretoik.verification.run_contents import RunContents

MEASURES = "paretoik.resolution.measures"  # where objectives of resolved motions are defined


def check_tuning(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check the stored motions of tuned methods: times, starts, distance from the path, and objectives as bounds."""
    task = problem.task
    listed = [str(each["name"]) for each in run.objectives]
    names = [each.name for each in task.objectives]
    yield demand("objectives' names", listed == names, f"the problem has {names}, run.json {listed}")
    yield from check_path(task, model)
    for row, number in enumerate(run.ids.tolist()):
        time, q = (np.asarray(run.motions[name][row], dtype=float) for name in ("time", "q"))
        times = np.asarray(task.times)
        if len(time) != len(times) or not np.allclose(time, times, rtol=0.0, atol=TOLERANCES.times * times[-1]):
            yield leave_out("motions against the path", "the method takes its own time", point=number)
            continue
        yield _check_start(run, problem, q[0], row, number)
        errors = sample_errors(model, task, q)
        if problem.tolerance is not None and float(run.table["violation"][row]) <= 0:
            off = float(np.abs(errors).max())
            detail = f"its tool is {off:.3g} off the path, {problem.tolerance:g} is the tolerance"
            yield judge("tracking", off, float(problem.tolerance) * (1 + TOLERANCES.values), detail, point=number)
        if listed == names:
            motion = measure(model, task, time, q)
            yield from _check_objectives(run, problem, motion, errors, row, number)
    yield from _left_out(problem)


def sample_errors(model: ArmModel, task: Any, q: np.ndarray) -> np.ndarray:
    """Return the errors (time, rows) [m, rad] of all task equations at the samples."""
    parts = list[np.ndarray]()
    for each in task.tasks:
        positions, rotations = sample_points(each.path)
        size, turning = task_axes(each, model.arm)
        here, place = model.poses(q, each.frame)
        parts.append(positions[:, :size] - place[:, :size])
        if turning and rotations is not None:
            parts.append(orientation_errors(each.axes, here, rotations)[:, list(turning)])
    return np.concatenate(parts, axis=1)


def _check_start(run: RunContents, problem: Any, posture: np.ndarray, row: int, point: int) -> Check:
    """Check that a motion begins in its own start: of several that its gene chooses, else the first."""
    starts = np.asarray(problem.starts)
    names = [each.name for each in problem.parameters]
    if "start" not in names:
        possible = starts[:1]
    elif "genes" in run.motions:
        share = float(np.asarray(run.motions["genes"])[row, names.index("start")])
        possible = starts[[min(int(share * len(starts)), len(starts) - 1)]]
    else:
        possible = starts
    off = float(np.abs(possible - posture).max(axis=1).min())
    return judge("start", off, TOLERANCES.on_path, "it does not begin in the start that is its own", point=point)


def _check_objectives(
    run: RunContents, problem: Any, motion: MeasuredMotion, errors: np.ndarray, row: int, point: int
) -> Iterator[Check]:
    """Check the table's objectives: equal to the stored motion's where that alone counts, else no better."""
    alone = problem.judged_starts == 1
    for objective, entry, value in zip(problem.task.objectives, run.objectives, run.values[row], strict=True):
        subject = f"objective {objective.name}"
        if not alone and problem.judged_by != "worst":
            continue
        try:
            expected = _value(objective, motion, errors)
        except Exception as fault:  # a user's function may raise anything
            line = (str(fault).splitlines() or [type(fault).__name__])[0]
            yield leave_out(subject, f"its function fails here: {line}", point=point)
            continue
        if expected is None:
            yield leave_out(subject, "it counts what the method did, which is not in the files", point=point)
            continue
        low, high = entry.get("range", (0.0, 0.0))
        size = max(abs(expected), abs(float(high) - float(low)), 1e-12)
        better = (expected - value) * (-1.0 if objective.maximise else 1.0)
        text = f"the table says {value:.10g} {objective.unit}".rstrip()
        if alone:
            yield judge(subject, abs(better) / size, TOLERANCES.values, f"{text}, it is {expected:.10g}", point=point)
        else:
            detail = f"{text}, the worst of {problem.judged_starts}; one of them alone has {expected:.10g}"
            yield judge(subject, max(better, 0.0) / size, TOLERANCES.values, detail, point=point)


def _value(objective: Any, motion: MeasuredMotion, errors: np.ndarray) -> float | None:
    """Return an objective of a stored motion; None of what only the method knows."""
    function = objective.function
    if getattr(function, "__module__", None) != MEASURES:
        return objective_value(objective, motion)
    if function.__name__ == "distance":
        return _distance(motion, inspect.getclosurevars(function).nonlocals["reference"])
    definition = DEFINITIONS.get(function.__name__)
    return None if definition is None else definition(motion, errors)


def _tracking_error(motion: MeasuredMotion, errors: np.ndarray) -> float:
    return float(np.abs(errors).max())


def _limit_margin(motion: MeasuredMotion, errors: np.ndarray) -> float:
    margins = [
        min(float(joint.min() - low), float(high - joint.max())) / (high - low)
        for joint, (low, high) in zip(motion.q[0].T, motion.arm.position_limits, strict=True)
        if np.isfinite(high - low)
    ]
    return min(margins, default=0.0)


def _speed_ratio(motion: MeasuredMotion, errors: np.ndarray) -> float:
    limits = [limit if np.isfinite(limit) else 1.0 for limit in motion.arm.velocity_limits]
    return max(float(np.abs(speed).max()) / limit for speed, limit in zip(motion.dq[0].T, limits, strict=True))


def _duration(motion: MeasuredMotion, errors: np.ndarray) -> float:
    return float(motion.duration[0])


DEFINITIONS: dict[str, Callable[[MeasuredMotion, np.ndarray], float]] = {
    "tracking_error": _tracking_error,
    "limit_margin": _limit_margin,
    "speed_ratio": _speed_ratio,
    "duration": _duration,
}


def _distance(motion: MeasuredMotion, reference: Any) -> float:
    """Return the joint distance from another motion, RMS over time, angles modulo whole turns."""
    difference = motion.q[0] - np.asarray(reference.q)
    turns = np.where(motion.arm.periodic, np.round(difference / (2 * np.pi)), 0.0)
    return float(np.sqrt(((difference - 2 * np.pi * turns) ** 2).sum(axis=1).mean()))


def _left_out(problem: Any) -> Iterator[Check]:
    """Say exactly what of the objectives was not computed a second time."""
    count = problem.judged_starts
    if count > 1 and problem.judged_by == "worst":
        reason = f"of {count} motions that the table has the worst of one is stored: the table is no better than that"
        yield leave_out("objectives from the other starts", reason)
    elif count > 1:
        reason = f"the table has the mean of {count} motions, of which one is stored: no objective was computed again"
        yield leave_out("objectives from all starts", reason)
    yield leave_out(
        "the method's steps", "the stored motion is not resolved a second time from the method's numbers and its start"
    )
