"""Checks of stored motions: path, limits, obstacles and objectives. Limits are checked at samples and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from paretoik.inputs import first_line
from paretoik.verification.arm_model import ArmModel
from paretoik.verification.limits import clearance_range, excesses
from paretoik.verification.measured_motion import MeasuredMotion, clearances, nearest_pair, rebuild
from paretoik.verification.objectives import objective_size, objective_value, stated_value
from paretoik.verification.path_targets import path_points, path_targets, sample_points, task_errors, tracking_errors
from paretoik.verification.run_contents import Check, RunContents, Worst, judge, leave_out
from paretoik.verification.tolerances import OPTIONS, TOLERANCES


def check_path(task: Any, model: ArmModel) -> Iterator[Check]:
    """Check that the samples of every path are on its recomputed curve."""
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
        distance, angle = tracking_errors(model, each, q)
        error = np.maximum(distance / model.length, angle)
        k = int(error.argmax())
        frame, share = each.frame.strip("<>"), TOLERANCES.on_path
        detail = f"{frame} is {distance[k]:.3g} m, {angle[k]:.3g} rad off its path at sample {k} ({time[k]:.4g} s)"
        place = Worst(what="distance", joint=frame, time=float(time[k]), value=float(distance[k]), unit="m")
        if angle[k] > distance[k] / model.length:
            place = Worst(what="angle", joint=frame, time=float(time[k]), value=float(angle[k]), unit="rad")
        yield judge("tracking at samples", float(error.max()), share, detail, point=point, worst=place)
    ends = [("start", "its start", 0, task.start), ("closure", "its first sample", -1, q[0] if task.cyclic else None)]
    for subject, name, k, wanted in ends:
        if wanted is None:
            continue
        off = np.abs((q[k] - wanted) / model.scales)
        j = int(off.argmax())
        joint, is_, limit = model.arm.joint_names[j], float(q[k, j]), float(wanted[j])
        place = Worst(what="position", joint=joint, time=float(time[k]), value=is_, limit=limit)
        detail = f"{joint} is at {is_:.10g}, {name} is {limit:.10g}"
        yield judge(subject, float(off[j]), TOLERANCES.on_path, detail, point=point, worst=place)


def check_limits(task: Any, motion: MeasuredMotion, violation: float | None, point: int) -> Iterator[Check]:
    """Check limits, clearance and constraints at the instants, and the table's violation."""
    largest = 0.0
    for subject, excess, place, fault in excesses(task, motion):
        if place is None:
            yield leave_out(subject, fault, point=point)
            continue
        largest = max(largest, excess) if np.isfinite(excess) else excess
        detail = f"{place}: exceeded by {excess:.3g} of its range"
        yield judge(subject, max(excess, 0.0), TOLERANCES.limits, detail, point=point, worst=place)
    if violation is not None:
        detail = f"the table says {violation:.3g}, but recomputing gives {largest:.3g}"
        yield judge("violation in the table", abs(violation - largest), TOLERANCES.limits, detail, point=point)


def check_objectives(
    run: RunContents, objectives: Any, motion: MeasuredMotion, values: np.ndarray, point: int
) -> Iterator[Check]:
    """Check one motion's objectives, computed again, against the table."""
    for objective, entry, value in zip(objectives, run.objectives, values, strict=True):
        subject = f"objective {objective.name}"
        try:
            expected = stated_value(objective, motion, value)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(subject, f"its function fails here: {first_line(fault)}", point=point)
            continue
        off = abs(value - expected) / objective_size(entry, expected)
        detail = f"the table says {value:.10g} {objective.unit}, but recomputing gives {expected:.10g}"
        yield judge(subject, off, TOLERANCES.values, detail, point=point)


def check_errors(
    run: RunContents, objectives: Any, motion: MeasuredMotion, finer: MeasuredMotion, row: int, *, promised: bool
) -> Iterator[Check]:
    """Check the discretisation errors of objectives: differences between samples and curve (``finer``).

    They must agree with the table and, if ``promised``, be within the tolerance.
    """
    for objective, entry, stated_as in zip(objectives, run.objectives, run.values[row], strict=True):
        subject, column = f"error of {objective.name}", f"discretisation error of {objective.name}"
        try:
            value, true = stated_value(objective, motion, stated_as), objective_value(objective, finer)
        except Exception:  # a user's function may raise any error; the row of its value has the reason
            continue
        size, point = objective_size(entry, value), int(run.ids[row])
        share = abs(true - value) / size
        if promised:
            detail = f"{100 * share:.2g} % of its size on the curve"
            yield judge(subject, share, TOLERANCES.resolved, detail, point=point)
        if column in run.table and np.isfinite(run.table[column][row]):
            stated = float(run.table[column][row]) / size
            detail = f"the table says {100 * stated:.2g} % of its size, but recomputing gives {100 * share:.2g} %"
            yield judge(f"{subject} in the table", abs(stated - share), TOLERANCES.error, detail, point=point)


# Motions between their samples: the curve, projected onto the path, with its limits and distances.
#
# A curve is projected at Chebyshev points of each interval and is the polynomial through them; rates are its
# derivatives.


def project(
    model: ArmModel, tasks: Any, q: np.ndarray, t: np.ndarray, normal_at: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return postures moved onto the path along the normals at ``normal_at``, and their remaining errors."""
    targets = path_targets(tasks, t)
    result, error = np.array(q), np.zeros(len(t))
    for row in range(len(t)):
        normal = None if normal_at is None else task_errors(model, targets, normal_at[row], row)[1]
        for _ in range(OPTIONS.newton_steps):
            miss, jacobian = task_errors(model, targets, result[row], row)
            normal = jacobian if normal is None else normal
            error[row] = np.abs(miss).max()
            if error[row] < 1e-13:
                break
            directions = model.scales[:, None] ** 2 * normal.T
            step = np.linalg.lstsq(jacobian @ directions, miss, rcond=None)[0]
            result[row] = result[row] + directions @ step
    return result, error


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectedCurve:
    """A motion's curve on its path, as Chebyshev series (pieces, nodes, dof) between ``edges``.

    error: largest distance of the nodes from the path [share of the arm's length, rad]
    at: its time [s]
    """

    edges: np.ndarray
    series: np.ndarray
    error: float
    at: float

    def __call__(self, t: np.ndarray, order: int = 0) -> np.ndarray:
        """Return positions (times, dof) at times [s], or their derivatives of an ``order``."""
        piece = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.series) - 1)
        low, high = self.edges[piece], self.edges[piece + 1]
        place = 2 * (t - low) / (high - low) - 1
        series = np.swapaxes(self.series, 0, 1)
        terms = (chebyshev.chebder(series, order) if order else series)[:, piece]
        powers = np.cos(np.arange(len(terms))[:, None] * np.arccos(np.clip(place, -1.0, 1.0)))
        return np.einsum("nt,ntj->tj", powers, terms) * (2.0 / (high - low))[:, None] ** order


def project_curve(task: Any, model: ArmModel, time: np.ndarray, q: np.ndarray) -> ProjectedCurve:
    """Return the curve of samples (time, dof) on the path, in pieces halved until they are smooth."""
    options = {"differences": task.differences, "cyclic": task.cyclic, "ends_at_rest": task.ends_at_rest}
    curve = rebuild(time, q, **options)
    nodes = chebyshev.chebpts1(OPTIONS.nodes)
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, OPTIONS.nodes - 1))
    worst, at = 0.0, float(time[0])
    fitted, open_ = [], np.stack([time[:-1], time[1:]], axis=1)
    for level in range(OPTIONS.splits + 1):
        t = (open_.mean(axis=1, keepdims=True) + np.diff(open_) / 2 * nodes).ravel()
        on_path, error = project(model, task.tasks, curve(t), t)
        if not error.max() <= worst:
            worst, at = float(error.max()), float(t[int(error.argmax())])
        series = np.einsum("nm,pmj->pnj", inverse, on_path.reshape(len(open_), len(nodes), -1))
        rough = (np.abs(series[:, -2:]).max(axis=(1, 2)) > OPTIONS.tail) & (level < OPTIONS.splits)
        fitted += [(low, high, each) for (low, high), each in zip(open_[~rough], series[~rough], strict=True)]
        middle = open_[rough].mean(axis=1)
        open_ = np.concatenate([np.stack([open_[rough, 0], middle], 1), np.stack([middle, open_[rough, 1]], 1)])
        if not len(open_):
            break
    fitted.sort(key=lambda piece: float(piece[0]))
    edges = np.array([piece[0] for piece in fitted] + [time[-1]])
    return ProjectedCurve(edges=edges, series=np.array([piece[2] for piece in fitted]), error=worst, at=at)


def finer_motion(task: Any, model: ArmModel, curve: ProjectedCurve, time: np.ndarray) -> MeasuredMotion:
    """Return the curve of a motion at many instants per interval, with Simpson's weights."""
    count = OPTIONS.finer
    step, t = np.repeat(np.diff(time) / count, count), divided(time, count)
    weights = np.zeros(len(t))
    for k in range(0, len(t) - 1, 2):
        weights[k : k + 3] += step[k] / 3 * np.array([1.0, 4.0, 1.0])
    state: dict[str, Any] = {name: curve(t, order)[None] for order, name in enumerate(("q", "dq", "ddq", "jerk"))}
    return MeasuredMotion(model=model, task=task, time=t[None], weights=weights, **state)


def divided(time: np.ndarray, count: int) -> np.ndarray:
    """Return times with every interval divided into ``count`` equal ones."""
    return np.append((time[:-1, None] + np.diff(time)[:, None] * np.arange(count) / count).ravel(), time[-1])


def check_between(
    samples: MeasuredMotion,
    finer: MeasuredMotion,
    curve: ProjectedCurve,
    stated: float | None,
    point: int,
    *,
    promised: bool,
) -> Iterator[Check]:
    """Check one motion between its samples; clearance is checked at all times.

    stated: bound of the violation between samples in the table, None if it has none
    promised: whether there must be no violation
    """
    task = samples.task
    detail = f"it leaves its path by {curve.error:.3g} at {curve.at:.4g} s"
    yield judge("tracking between samples", curve.error, TOLERANCES.on_path, detail, point=point)
    found = list[tuple[float, Worst]]()
    for subject, excess, where, fault in excesses(task, finer):
        if where is None:
            yield leave_out(f"{subject} between samples", fault, point=point)
        else:
            found.append((np.inf if np.isnan(excess) else excess, where))
    kept = [each for each in found if each[1].what != "clearance"]  # clearance is checked below, at every time
    if kept:
        excess, place = max(kept, key=lambda each: each[0])
        excess = float(max(excess, 0.0))
        subject, detail = "limits between samples", f"{place}: exceeded by {excess:.3g} of its range"
        row = judge(subject, excess, TOLERANCES.between, detail, point=point, worst=place)
        if not promised and row.verdict == "failed":
            spline = task.differences == "spline"
            reason = "a point that is not a minimum" if spline else f"differences={task.differences!r}"
            row = replace(row, verdict="noted", detail=f"nothing is promised between samples of {reason}")
        yield row
    if stated is not None:
        largest, worst = max(found, key=lambda each: each[0], default=(0.0, None))
        largest, subject = max(largest, 0.0), "violation_between in the table"
        detail, short = f"the table says {stated:.3g}, but it is {largest:.3g}", largest - min(stated, largest)
        yield judge(subject, short, TOLERANCES.stated, detail, point=point, worst=worst)
    if not task.obstacles:
        return
    smallest, at, proven = least_clearance(samples, curve, samples.time[0])
    model, size = samples.model, clearance_range(task, samples.model)
    short = max(float(task.min_clearance) - smallest, 0.0)
    pair = nearest_pair(task.obstacles, model.nodes(curve(np.array([at])))[0], samples.link_radius)
    place = Worst(what="clearance", joint=pair, time=at, value=smallest, limit=float(task.min_clearance), unit="m")
    row = judge("clearance between samples", short, TOLERANCES.between * size, str(place), point=point, worst=place)
    if row.verdict == "failed" and not promised:
        # In an interval h, a link with speed v on a curve of radius R dips by v²h²/8R between samples that are clear of
        # the obstacle; a link with acceleration a dips by a h²/8. Half the smallest obstacle size is the most.
        sizes = [getattr(each, "half_sizes", getattr(each, "radius", np.inf)) for each in samples.obstacles]
        smallest_size, step = min(float(np.min(each)) for each in sizes), np.diff(samples.time[0])
        moves = np.diff(samples.links[0], axis=0)
        v = (np.linalg.norm(moves, axis=-1).max(axis=1) / step).max()
        a = np.linalg.norm(np.diff(moves, axis=0), axis=-1).max(initial=0.0) / step.min() ** 2
        bend = a + v**2 / (smallest_size + np.min(samples.link_radius))
        if short <= min(np.diff(np.asarray(task.times)).max() ** 2 / 8 * bend, smallest_size / 2):
            reason = "nothing is promised between samples of a point that is not a minimum"
            row = replace(row, verdict="noted", detail=reason)
    yield row
    if not proven:
        yield leave_out(row.subject, "an interval is too near to an obstacle to be sure", point=point)


def least_clearance(
    samples: MeasuredMotion, postures: Callable[[np.ndarray], np.ndarray], time: np.ndarray
) -> tuple[float, float, bool]:
    """Return the least clearance, its time, and whether it is proven.

    Intervals are halved until their ends and lengths exclude that they come below the limit.
    """
    task, model = samples.task, samples.model
    t = divided(time, OPTIONS.instants)
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
