"""Closed loops: what the run says of the tool's error, the drift, steps and objectives of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import interp1d

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.between_checks import least_clearance
from paretoik.verification.measured_motion import MeasuredMotion, measure
from paretoik.verification.motion_checks import check_limits
from paretoik.verification.options import TOLERANCES
from paretoik.verification.path_targets import sample_points, tracking_errors
from paretoik.verification.report import Check, Worst, judge, leave_out
from paretoik.verification.run_contents import RunContents

LIBRARY = "paretoik.closed_loop.objectives"


def check_loop(run: RunContents, loop: Any, model: ArmModel) -> Iterator[Check]:
    """Check the one motion of a closed loop, which follows its path as nearly as its choices let it."""
    point, q, time = int(run.ids[0]), run.motions["q"][0], run.motions["time"][0]
    task = loop.task.truncate(len(q))
    times, step = np.asarray(task.times), float(loop.task.times[1] - loop.task.times[0])
    off = float(np.abs(time - times).max() / times[-1])
    yield judge("times of the path", off, TOLERANCES.times, "its times are not those of the path", point=point)
    distances, angles = (
        np.max(parts, axis=0)
        for parts in zip(*(tracking_errors(model, t, q, *sample_points(t.path)) for t in task.tasks), strict=True)
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
        yield from _check_sweep(task, model, motion, time, q, point)
    elif task.obstacles:
        yield leave_out("clearance between samples", "steps of any length are clear where they end alone", point=point)
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


def _check_sweep(
    task: Any, model: ArmModel, motion: MeasuredMotion, time: np.ndarray, q: np.ndarray, point: int
) -> Iterator[Check]:
    """Check distances during steps, which are straight in joints."""
    straight = interp1d(time, q, axis=0)
    smallest, at, proven = least_clearance(task, model, straight, motion, time)
    short = float(task.min_clearance) - smallest
    detail = f"links come within {smallest:.4g} m of an obstacle at {at:.4g} s, the limit is {task.min_clearance:g} m"
    tolerance = TOLERANCES.limits * model.length
    yield judge("clearance between samples", max(short, 0.0), tolerance, detail, point=point)
    if not proven:
        yield leave_out("clearance between samples", "a step is too near to an obstacle to be sure", point=point)
