"""Stored motions against their problem: the path, limits and obstacles at samples and between, objectives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.library_objectives import objective_value
from paretoik.verification.measured_motion import MeasuredMotion
from paretoik.verification.motion_limits import clearance_range, constraint_excess, limit_excess
from paretoik.verification.options import OPTIONS
from paretoik.verification.path_targets import path_points, sample_points, tracking_errors
from paretoik.verification.report import Check, demand, judge, leave_out
from paretoik.verification.run_contents import RunContents


def check_joints(run: RunContents, arm: Any) -> Iterator[Check]:
    """Check that the stored joints are those of the arm, in its order."""
    stored = [str(name) for name in run.motions["joint_names"]]
    names = ", ".join(arm.joint_names)
    yield demand("joint names", stored == list(arm.joint_names), f"wanted {names}, got {', '.join(stored)}")


def check_path(task: Any, model: ArmModel) -> Iterator[Check]:
    """Check that the samples of every path lie on its curve, which is worked out anew."""
    for each in task.tasks:
        positions, rotations = path_points(each.path, np.asarray(each.path.times))
        listed, turned = sample_points(each.path)
        off = float(np.abs(positions - listed).max()) / model.length
        if rotations is not None and turned is not None:
            off = max(off, float(np.abs(rotations - turned).max()))
        yield judge("samples of the path", off, OPTIONS.on_path, "the samples of the path are not on its curve")


def check_samples(task: Any, model: ArmModel, time: np.ndarray, q: np.ndarray, point: int) -> Iterator[Check]:
    """Check times, tracking, the start and the closure of one motion at its samples."""
    times = np.asarray(task.times)
    off = float(np.abs(time - times).max() / times[-1]) if len(time) == len(times) else np.inf
    yield judge("times of the path", off, 1e-9, "its times are not those of the path", point=point)
    if not off <= 1e-9:
        return
    for each in task.tasks:
        positions, rotations = sample_points(each.path)
        distance, angle = tracking_errors(model, each, q, positions, rotations)
        error = np.maximum(distance / model.length, angle)
        worst = int(error.argmax())
        error_text = f"{distance[worst]:.3g} m, {angle[worst]:.3g} rad off its path at sample {worst}"
        where = f"{each.frame.strip('<>')} is {error_text}"
        yield judge("tracking at samples", float(error.max()), OPTIONS.on_path, where, point=point)
    if task.start is not None:
        off = float(np.abs((q[0] - task.start) / model.scales).max())
        yield judge("start", off, OPTIONS.on_path, "it does not begin in the problem's start", point=point)
    if task.cyclic:
        off = float(np.abs((q[-1] - q[0]) / model.scales).max())
        yield judge("closure", off, OPTIONS.on_path, "it does not end where it begins", point=point)


def check_limits(
    task: Any, motion: MeasuredMotion, violation: float | None, point: int, *, tolerance: float = OPTIONS.limits
) -> Iterator[Check]:
    """Check limits, clearance and a user's constraints at the instants of the problem, and the table's violation."""
    largest = 0.0
    for kind, (excess, where) in limit_excess(task, motion).items():
        largest = max(largest, excess)
        detail = f"{where} is exceeded by {excess:.3g} of its range"
        yield judge(f"{kind} limits", max(excess, 0.0), tolerance, detail, point=point)
    if task.obstacles:
        short = float(task.min_clearance - motion.clearance.min()) / clearance_range(task, motion.model)
        largest = max(largest, short)
        at = motion.time[0, int(motion.clearance.argmin())]
        detail = f"clearance is {motion.clearance.min():.4g} m at {at:.4g} s, {task.min_clearance:g} m wanted"
        yield judge("clearance at samples", max(short, 0.0), tolerance, detail, point=point)
    for each in task.constraints:
        try:
            excess = constraint_excess(each, motion)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(f"constraint {each.name}", f"its function fails here: {_line(fault)}", point=point)
            continue
        largest = max(largest, excess)
        detail = f"it is violated by {excess:.3g} of its scale"
        yield judge(f"constraint {each.name}", max(excess, 0.0), tolerance, detail, point=point)
    if violation is not None:
        detail = f"the table says {violation:.3g}, it is {largest:.3g}"
        yield judge("violation in the table", abs(violation - largest), OPTIONS.limits, detail, point=point)


def check_objectives(
    run: RunContents, objectives: Any, motion: MeasuredMotion, values: np.ndarray, point: int
) -> Iterator[Check]:
    """Check one motion's objectives, computed again, against the table."""
    for objective, entry, value in zip(objectives, run.objectives, values, strict=True):
        subject = f"objective {objective.name}"
        try:
            expected = objective_value(objective, motion)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(subject, f"its function fails here: {_line(fault)}", point=point)
            continue
        low, high = entry.get("range", (0.0, 0.0))
        size = max(abs(expected), abs(float(high) - float(low)), 1e-12)
        detail = f"the table says {value:.10g} {objective.unit}, it is {expected:.10g}"
        yield judge(subject, abs(value - expected) / size, OPTIONS.values, detail, point=point)


def _line(fault: Exception) -> str:
    return (str(fault).splitlines() or [type(fault).__name__])[0]
