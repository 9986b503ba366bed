"""Stored motions against their problem: the path, limits and obstacles at samples and between, objectives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.library_objectives import objective_value, stated_value
from paretoik.verification.measured_motion import MeasuredMotion
from paretoik.verification.motion_limits import worst_of_clearance, worst_of_constraint, worst_of_limits
from paretoik.verification.options import TOLERANCES
from paretoik.verification.path_targets import path_points, sample_points, tracking_errors
from paretoik.verification.report import Check, Worst, demand, judge, leave_out
from paretoik.verification.run_contents import RunContents


def check_joints(run: RunContents, arm: Any) -> Iterator[Check]:
    """Check that the stored joints are those of the arm, in its order."""
    stored = [str(name) for name in run.motions["joint_names"]]
    names = ", ".join(arm.joint_names)
    yield demand("joint names", stored == list(arm.joint_names), f"joints must be {names}, got {', '.join(stored)}")


def check_path(task: Any, model: ArmModel) -> Iterator[Check]:
    """Check that the samples of every path lie on its curve, which is computed again."""
    for each in task.tasks:
        positions, rotations = path_points(each.path, np.asarray(each.path.times))
        listed, turned = sample_points(each.path)
        off = float(np.abs(positions - listed).max()) / model.length
        if rotations is not None and turned is not None:
            off = max(off, float(np.abs(rotations - turned).max()))
        yield judge("samples of the path", off, TOLERANCES.on_path, "the samples of the path are not on its curve")


def check_samples(task: Any, model: ArmModel, time: np.ndarray, q: np.ndarray, point: int) -> Iterator[Check]:
    """Check times, tracking, the start and the closure of one motion at its samples."""
    times = np.asarray(task.times)
    off = float(np.abs(time - times).max() / times[-1]) if len(time) == len(times) else np.inf
    yield judge("times of the path", off, TOLERANCES.times, "its times are not those of the path", point=point)
    if not off <= TOLERANCES.times:
        return
    for each in task.tasks:
        positions, rotations = sample_points(each.path)
        distance, angle = tracking_errors(model, each, q, positions, rotations)
        error = np.maximum(distance / model.length, angle)
        k = int(error.argmax())
        frame, share = each.frame.strip("<>"), TOLERANCES.on_path
        detail = f"{frame} is {distance[k]:.3g} m, {angle[k]:.3g} rad off its path at sample {k} ({time[k]:.4g} s)"
        place = Worst(what="distance", joint=frame, time=float(time[k]), value=float(distance[k]), unit="m")
        if angle[k] > distance[k] / model.length:
            place = Worst(what="angle", joint=frame, time=float(time[k]), value=float(angle[k]), unit="rad")
        yield judge("tracking at samples", float(error.max()), share, detail, point=point, worst=place)
    if task.start is not None:
        yield _same_posture("start", model, q[0], task.start, float(time[0]), "its start", point)
    if task.cyclic:
        yield _same_posture("closure", model, q[-1], q[0], float(time[-1]), "where it begins", point)


def _same_posture(
    subject: str, model: ArmModel, q: np.ndarray, wanted: np.ndarray, time: float, name: str, point: int
) -> Check:
    """Return whether a posture is another one, and which joint is farthest from it."""
    off = np.abs((q - wanted) / model.scales)
    j = int(off.argmax())
    place = Worst(what="position", joint=model.arm.joint_names[j], time=time, value=float(q[j]), limit=float(wanted[j]))
    detail = f"{place.joint} is at {q[j]:.10g}, {name} is {wanted[j]:.10g}"
    return judge(subject, float(off[j]), TOLERANCES.on_path, detail, point=point, worst=place)


def check_limits(task: Any, motion: MeasuredMotion, violation: float | None, point: int) -> Iterator[Check]:
    """Check limits, clearance and a user's constraints at the instants of the problem, and the table's violation."""
    largest = 0.0
    for subject, excess, place, fault in excesses(task, motion):
        if place is None:
            yield leave_out(subject, fault, point=point)
            continue
        largest = max(largest, excess) if np.isfinite(excess) else excess
        detail = f"{place}: exceeded by {excess:.3g} of its range"
        yield judge(subject, max(excess, 0.0), TOLERANCES.limits, detail, point=point, worst=place)
    if violation is not None:
        detail = f"the table says {violation:.3g}, it is {largest:.3g}"
        yield judge("violation in the table", abs(violation - largest), TOLERANCES.limits, detail, point=point)


def excesses(task: Any, motion: MeasuredMotion) -> Iterator[tuple[str, float, Worst | None, str]]:
    """Yield of every limit its subject, the worst excess as a share of its range, and where; or why it is unknown."""
    for kind, (excess, place) in worst_of_limits(task, motion).items():
        yield f"{kind} limits", excess, place, ""
    if task.obstacles:
        yield "clearance at samples", *worst_of_clearance(task, motion), ""
    for each in task.constraints:
        try:
            yield f"constraint {each.name}", *worst_of_constraint(each, motion), ""
        except Exception as fault:  # a user's function may raise anything
            yield f"constraint {each.name}", np.nan, None, f"its function fails here: {_line(fault)}"


def check_objectives(
    run: RunContents, objectives: Any, motion: MeasuredMotion, values: np.ndarray, point: int
) -> Iterator[Check]:
    """Check one motion's objectives, computed again, against the table."""
    for objective, entry, value in zip(objectives, run.objectives, values, strict=True):
        subject = f"objective {objective.name}"
        try:
            expected = stated_value(objective, motion, value)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(subject, f"its function fails here: {_line(fault)}", point=point)
            continue
        low, high = entry.get("range", (0.0, 0.0))
        size = max(abs(expected), abs(float(high) - float(low)), 1e-12)
        detail = f"the table says {value:.10g} {objective.unit}, it is {expected:.10g}"
        yield judge(subject, abs(value - expected) / size, TOLERANCES.values, detail, point=point)


def check_errors(
    run: RunContents, objectives: Any, motion: MeasuredMotion, finer: MeasuredMotion, row: int, *, promised: bool
) -> Iterator[Check]:
    """Check how far the values of one motion are off those of its curve, against the table and the promise."""
    for objective, entry, stated_as in zip(objectives, run.objectives, run.values[row], strict=True):
        subject, column = f"error of {objective.name}", f"discretisation error of {objective.name}"
        try:
            value, true = stated_value(objective, motion, stated_as), objective_value(objective, finer)
        except Exception:  # a user's function may raise anything: said of its value
            continue
        low, high = entry.get("range", (0.0, 0.0))
        size, point = max(abs(value), abs(float(high) - float(low)), 1e-12), int(run.ids[row])
        share = abs(true - value) / size
        if promised:
            detail = f"{100 * share:.2g} % of its size on the curve"
            yield judge(subject, share, TOLERANCES.resolved, detail, point=point)
        if column in run.table and np.isfinite(run.table[column][row]):
            stated = float(run.table[column][row]) / size
            detail = f"the table says {100 * stated:.2g} % of its size, it is {100 * share:.2g} %"
            yield judge(f"{subject} in the table", abs(stated - share), TOLERANCES.error, detail, point=point)


def _line(fault: Exception) -> str:
    return (str(fault).splitlines() or [type(fault).__name__])[0]
