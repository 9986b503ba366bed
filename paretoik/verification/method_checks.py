"""Checks of tuned methods, resolved motions and closed loops."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import interp1d

from paretoik.inputs import first_line
from paretoik.verification.arm_model import ArmModel
from paretoik.verification.measured_motion import MeasuredMotion, measure
from paretoik.verification.motion_checks import check_limits, check_path, least_clearance
from paretoik.verification.objectives import objective_size, objective_value
from paretoik.verification.path_targets import frame_errors, tracking_errors
from paretoik.verification.run_contents import Check, RunContents, Worst, demand, judge, leave_out
from paretoik.verification.tolerances import TOLERANCES

# Tuned methods: each point has one stored motion, which gives bounds for the values in the table.
#
# The table has the worst, or the mean, of motions from several starts; only the first of them is stored. The method
# is not run a second time, so the stored motion bounds a worst value from one side only.


MEASURES = "paretoik.resolution.measures"  # defines objectives of resolved motions


def check_tuning(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check the stored motions of tuned methods: times, starts, tracking, and objectives as bounds."""
    task = problem.task
    listed = [str(each["name"]) for each in run.objectives]
    names = [each.name for each in task.objectives]
    yield demand("objectives' names", listed == names, f"the problem has {names}, but run.json lists {listed}")
    yield from check_path(task, model)
    for row, number in enumerate(run.ids.tolist()):
        time, q = (np.asarray(run.motions[name][row], dtype=float) for name in ("time", "q"))
        if not _has_times(time, task):
            yield leave_out("motions against the path", "the method takes its own time", point=number)
            continue
        # the motion begins at its own start: the one that its gene chooses, or the first
        possible, names_of_genes = np.asarray(problem.starts), [each.name for each in problem.parameters]
        if "start" not in names_of_genes:
            possible = possible[:1]
        elif "genes" in run.motions:
            share = float(np.asarray(run.motions["genes"])[row, names_of_genes.index("start")])
            possible = possible[[min(int(share * len(possible)), len(possible) - 1)]]
        off = float(np.abs(possible - q[0]).max(axis=1).min())
        yield judge("start", off, TOLERANCES.on_path, "it does not begin in the start that is its own", point=number)
        parts = [part for each in task.tasks for part in frame_errors(model, each, q)]
        errors = np.concatenate(parts, axis=1)
        if problem.tolerance is not None and float(run.table["violation"][row]) <= 0:
            off = float(np.abs(errors).max())
            detail = f"its tool is {off:.3g} off the path, {problem.tolerance:g} is the tolerance"
            yield judge("tracking", off, float(problem.tolerance) * (1 + TOLERANCES.values), detail, point=number)
        if listed == names:
            motion = measure(model, task, time, q)
            yield from _check_objectives(run, problem, motion, errors, row, number)
    # Parts of the objectives that were not computed a second time:
    count = problem.judged_starts
    if count > 1 and problem.judged_by == "worst":
        reason = f"one of {count} motions is stored, the table has the worst: it is no better than the stored one"
        yield leave_out("objectives from the other starts", reason)
    elif count > 1:
        reason = f"the table has the mean of {count} motions, but one is stored: no objective was computed again"
        yield leave_out("objectives from all starts", reason)
    yield leave_out(
        "the method's steps", "the stored motion is not resolved a second time from the method's numbers and its start"
    )


def _has_times(time: np.ndarray, task: Any) -> bool:
    times = np.asarray(task.times)
    return len(time) == len(times) and np.allclose(time, times, rtol=0.0, atol=TOLERANCES.times * times[-1])


def _check_objectives(
    run: RunContents, problem: Any, motion: MeasuredMotion, errors: np.ndarray, row: int, point: int
) -> Iterator[Check]:
    """Check that the table's objectives equal those of the stored motion, or are no better if others count."""
    alone = problem.judged_starts == 1
    for objective, entry, value in zip(problem.task.objectives, run.objectives, run.values[row], strict=True):
        subject = f"objective {objective.name}"
        if not alone and problem.judged_by != "worst":
            continue
        try:
            expected = _value(objective, motion, errors)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(subject, f"its function fails here: {first_line(fault)}", point=point)
            continue
        if expected is None:
            yield leave_out(subject, "it counts what the method did, which is not in the files", point=point)
            continue
        size = objective_size(entry, expected)
        better = (expected - value) * (-1.0 if objective.maximise else 1.0)
        text = f"the table says {value:.10g} {objective.unit}".rstrip()
        if alone:
            yield judge(subject, abs(better) / size, TOLERANCES.values, f"{text}, it is {expected:.10g}", point=point)
        else:
            detail = f"{text}, the worst of {problem.judged_starts}; one of them alone has {expected:.10g}"
            yield judge(subject, max(better, 0.0) / size, TOLERANCES.values, detail, point=point)


def _value(objective: Any, motion: MeasuredMotion, errors: np.ndarray) -> float | None:
    """Return an objective of a stored motion, None if only the method knows it."""
    function = objective.function
    if getattr(function, "__module__", None) != MEASURES:
        return objective_value(objective, motion)
    if function.__name__ == "distance":
        # the joint distance from another motion, RMS over time, angles modulo whole turns
        difference = motion.q[0] - np.asarray(inspect.getclosurevars(function).nonlocals["reference"].q)
        turns = np.where(motion.arm.periodic, np.round(difference / (2 * np.pi)), 0.0)
        return float(np.sqrt(((difference - 2 * np.pi * turns) ** 2).sum(axis=1).mean()))
    definition = DEFINITIONS.get(function.__name__)
    return None if definition is None else definition(motion, errors)


DEFINITIONS: dict[str, Callable[[MeasuredMotion, np.ndarray], float]] = {
    "tracking_error": lambda motion, errors: float(np.abs(errors).max()),
    "limit_margin": lambda motion, errors: min(
        (
            min(float(joint.min() - low), float(high - joint.max())) / (high - low)
            for joint, (low, high) in zip(motion.q[0].T, motion.arm.position_limits, strict=True)
            if np.isfinite(high - low)
        ),
        default=0.0,
    ),
    "speed_ratio": lambda motion, errors: max(
        float(np.abs(speed).max()) / (limit if np.isfinite(limit) else 1.0)
        for speed, limit in zip(motion.dq[0].T, motion.arm.velocity_limits, strict=True)
    ),
    "duration": lambda motion, errors: float(motion.duration[0]),
}


# Resolved motions: what the files state about the motion, and, if the problem is known, about the path.


def check_resolution(run: RunContents, task: Any, model: ArmModel | None, reason: str = "") -> Iterator[Check]:
    """Check the errors that a resolved motion states; ``task`` has its path, None if unknown."""
    traces = run.arrays.get("traces.npz", {})
    errors = np.asarray(traces.get("errors", np.empty(0)))
    stated = float(run.entries.get("largest_error", np.nan))
    largest = float(np.abs(errors).max(initial=0.0))
    yield judge(
        "largest error",
        abs(stated - largest),
        TOLERANCES.traces,
        f"run.json says {stated:.8g}, traces say {largest:.8g}",
    )
    counts = run.entries.get("counts", {}).get("steps", {})
    statuses = np.asarray(traces.get("status", np.empty(0))).ravel().tolist()
    yield demand("steps", sum(counts.values()) == len(statuses), "run.json counts other steps than the traces have")
    if task is None or model is None:
        missing = "arm and path are not in the files; verify(folder, problem) names them"
        yield leave_out("tracking", reason or missing)
        return
    for row, (time, q) in enumerate(zip(run.motions["time"], run.motions["q"], strict=True)):
        point = int(run.ids[row])
        same = _has_times(time, task)
        yield demand("times of the path", same, "its times are not those of the path", point=point)
        if not same:
            continue
        parts = [tracking_errors(model, each, q) for each in task.tasks]
        miss = max(float(max(distance.max(), angle.max())) for distance, angle in parts)
        admitted = float(np.linalg.norm(errors[row], axis=-1).max()) if errors.ndim > 2 else largest
        detail = f"the tool is {miss:.3g} off its path, its traces admit {admitted:.3g}"
        yield judge("tracking", miss, admitted + TOLERANCES.on_path, detail, point=point)
    yield leave_out("limits and the method's steps", "a method may exceed limits if its traces say so")


# Closed loops: the statements of a run.


LIBRARY = "paretoik.closed_loop.objectives"


def check_loop(run: RunContents, loop: Any, model: ArmModel) -> Iterator[Check]:
    """Check that the motion of a closed loop follows its path, and what the run states of it."""
    point, q, time = int(run.ids[0]), run.motions["q"][0], run.motions["time"][0]
    task = loop.task.truncate(len(q))
    times, step = np.asarray(task.times), float(loop.task.times[1] - loop.task.times[0])
    off = float(np.abs(time - times).max() / times[-1])
    yield judge("times of the path", off, TOLERANCES.times, "its times are not those of the path", point=point)
    distances, angles = (
        np.max(parts, axis=0) for parts in zip(*(tracking_errors(model, each, q) for each in task.tasks), strict=True)
    )
    mean, drift = float(distances[1:].mean()), float(np.linalg.norm(q[-1] - q[0]) / q.shape[1])
    for name, value in (("position_error", mean), ("drift", drift)):
        stated = float(run.entries.get(name, np.nan))
        detail = f"run.json says {stated:.10g}, it is {value:.10g}"
        yield judge(
            f"{name} of the loop", abs(stated - value), TOLERANCES.values * max(value, 1.0), detail, point=point
        )
    steps = np.abs(np.diff(q, axis=0))
    k, j = np.unravel_index(int(steps.argmax()), steps.shape)
    place = Worst(
        what="step", joint=model.arm.joint_names[j], time=float(time[k]), value=float(steps[k, j]), limit=loop.longest
    )
    too_far = max(float(steps[k, j]) - loop.longest, 0.0)
    yield judge("length of steps", too_far, TOLERANCES.on_path, str(place), point=point, worst=place)
    violation = float(run.table["violation"][0]) if "violation" in run.table else None
    motion = measure(model, task, time, q)
    limited = replace(
        task, bounds={kind: each for kind, each in task.bounds.items() if kind in ("position", "velocity")}
    )
    yield from check_limits(limited, motion, None, point)
    yield from (row for row in check_limits(task, motion, violation, point) if row.subject == "violation in the table")
    if task.obstacles and np.isfinite(loop.longest):
        # During steps, which are straight in joints:
        smallest, at, proven = least_clearance(motion, interp1d(time, q, axis=0), time)
        limit, tolerance = float(task.min_clearance), TOLERANCES.limits * model.length
        detail = (
            f"links come within {smallest:.4g} m of an obstacle at {at:.4g} s, the limit is {task.min_clearance:g} m"
        )
        yield judge("clearance between samples", max(limit - smallest, 0.0), tolerance, detail, point=point)
        if not proven:
            yield leave_out("clearance between samples", "a step is too near to an obstacle to be sure", point=point)
    elif task.obstacles:
        yield leave_out("clearance between samples", "steps of any length are only clear at their ends", point=point)
    velocity = np.diff(q, axis=0) / step
    series = {
        "joint_displacement": (velocity**2).sum(axis=1) + (((q[1:] - q[0]) / step) ** 2).sum(axis=1),
        "position_error": distances[1:],
        "rotation_error": angles[1:],
    }
    for objective, value in zip(loop.objectives, run.values[0], strict=True):
        subject = f"objective {objective.name}"
        function = objective.function
        if getattr(function, "__module__", "") != LIBRARY or objective.name not in series or len(task.tasks) > 1:
            yield leave_out(subject, "an objective of steps that is not the paper's", point=point)
            continue
        expected = float(series[objective.name].mean())
        detail = f"the table says {value:.10g} {objective.unit}, it is {expected:.10g}"
        yield judge(subject, abs(value - expected) / max(abs(expected), 1e-9), TOLERANCES.energies, detail, point=point)
