"""Certificates by differences: no direction along the self-motion improves what the weights say is critical.

Along directions d that keep the path, and to first order the limits, a point with weights λ is critical where no d
lowers Σ λᵢ f̂ᵢ: a linear program over a box inside the unit ball, whose value is at most the criticality's bound. Where
it is not, the program for all objectives at once tells apart false weights and a false certificate.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.between_checks import project
from paretoik.verification.library_objectives import objective_value
from paretoik.verification.measured_motion import measure
from paretoik.verification.motion_limits import constraint_excess, limit_shares
from paretoik.verification.options import OPTIONS
from paretoik.verification.path_targets import path_points, task_error
from paretoik.verification.report import Check, judge, leave_out
from paretoik.verification.run_contents import RunContents
from paretoik.verification.table_checks import certified_ranges

SUBJECTS = ("criticality by differences", "weights by differences")


def check_certificate(
    run: RunContents, task: Any, model: ArmModel, objectives: Any, row: int, time: np.ndarray, q: np.ndarray
) -> Iterator[Check]:
    """Check the criticality and the weights of one certified point."""
    point = int(run.ids[row])
    residual, weights = float(run.table["kkt_residual"][row]), np.asarray(run.motions["weights"][row])
    forms = [each.form for each in objectives] + [each.form for each in task.constraints]
    unfit = not np.isfinite(residual) or not np.isfinite(weights).all()
    if unfit or "peak" in forms or task.obstacles or (task.ends_at_rest and task.differences != "spline"):
        reason = (
            "the run has no certificate of it"
            if unfit
            else "peaks, clearances and tied ends are no smooth functions to difference"
        )
        for subject in SUBJECTS:
            yield leave_out(subject, reason, point=point)
        return
    size = certified_ranges(run)
    signs = np.array([-1.0 if each.get("maximised") else 1.0 for each in run.objectives])
    if (size <= 0).any():
        for subject in SUBJECTS:
            yield leave_out(subject, "a range in run.json is none", point=point)
        return
    basis = _directions(task, model, time, q)
    slopes, kinked = _differences(task, model, objectives, signs / size, time, q, basis)
    if kinked:
        for subject in SUBJECTS:
            yield leave_out(subject, "an objective or a limit has a kink there", point=point)
        return
    count, at = len(size), _evaluate(task, model, objectives, signs / size, time, q)
    gains, limits = slopes[:count], slopes[count:]
    box = 1.0 / np.sqrt(max(model.dof - int(task.rows), 1))
    weighted = _best_gain((weights @ gains)[None], limits, at[count:], box)
    near = task.differences == "spline" and (at[count:] > -OPTIONS.near).any()
    tolerance = max(residual, 0.0) + (OPTIONS.held if near else OPTIONS.criticality)
    together = weighted if weighted <= tolerance else _best_gain(gains, limits, at[count:], box)
    detail = f"a direction improves all objectives by {together:.3g} of their ranges, the table says {residual:.3g}"
    yield judge(SUBJECTS[0], together, tolerance, detail, point=point)
    detail = f"a direction improves the weighted sum by {weighted:.3g} of its range: the weights are others"
    steepest = box * float(np.abs(gains).sum(axis=1).max())
    yield judge(SUBJECTS[1], weighted, max(OPTIONS.weights * steepest, tolerance), detail, point=point)


def _directions(task: Any, model: ArmModel, time: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return directions (directions, time, dof) of the self-motion, one sample each, or smooth ones where too many."""
    frames = list[np.ndarray]()
    for k in range(len(time)):
        parts = []
        for each in task.tasks:
            x, turned = path_points(each.path, time[k : k + 1])
            parts.append(task_error(model, each, q[k], x[0], None if turned is None else turned[0])[1])
        free = null_space(np.concatenate(parts) * model.scales)
        if frames and free.shape == frames[-1].shape:  # turned alike, so that smooth combinations are smooth
            left, _, right = np.linalg.svd(free.T @ (frames[-1] / model.scales[:, None]))
            free = free @ left @ right
        frames.append(free * model.scales[:, None])
    redundancy = min(frame.shape[1] for frame in frames)
    moving = np.arange(len(time)) >= (task.start is not None)
    if task.cyclic:
        moving[-1] = False
    samples = np.flatnonzero(moving)
    shapes = np.eye(len(samples))
    if len(samples) * redundancy > OPTIONS.directions:
        knots = np.linspace(0, len(samples) - 1, max(OPTIONS.directions // redundancy, 2))
        hats = np.maximum(0.0, 1.0 - np.abs(np.arange(len(samples)) - knots[:, None]) / (knots[1] - knots[0]))
        shapes = hats
    basis = np.zeros((len(shapes), redundancy, *q.shape))
    for k, sample in enumerate(samples):
        basis[:, :, sample] = shapes[:, k, None, None] * frames[sample].T[:redundancy]
    if task.cyclic:
        basis[:, :, -1] = basis[:, :, 0]
    return basis.reshape(-1, *q.shape)


def _differences(
    task: Any, model: ArmModel, objectives: Any, factors: np.ndarray, time: np.ndarray, q: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Return slopes (values, directions) by central differences, and whether an objective has a kink there."""
    columns, kinked, count = [], False, len(objectives)
    at = _evaluate(task, model, objectives, factors, time, q)
    for direction in basis:
        ahead, back = (_moved(task, model, objectives, factors, time, q, each) for each in (direction, -direction))
        columns.append((ahead - back) / (2 * OPTIONS.step))
        bend = np.abs(ahead - 2 * at + back)[:count] / OPTIONS.step
        if (bend > OPTIONS.kink).any():  # of a smooth function a bend falls with the step
            nearer = [_moved(task, model, objectives, factors, time, q, each * 0.1) for each in (direction, -direction)]
            sharp = np.abs(nearer[0] - 2 * at + nearer[1])[:count] / (0.1 * OPTIONS.step)
            kinked = kinked or bool((sharp > 0.5 * bend)[bend > OPTIONS.kink].any())
    return np.array(columns).T, kinked


def _moved(
    task: Any, model: ArmModel, objectives: Any, factors: np.ndarray, time: np.ndarray, q: np.ndarray, by: np.ndarray
) -> np.ndarray:
    """Return the values of a motion moved by a small step along the self-motion, on the path again."""
    touched = np.flatnonzero(np.abs(by).max(axis=1) > 0)
    moved = q + OPTIONS.step * by
    moved[touched] = project(model, task.tasks, moved[touched], time[touched])[0]
    return _evaluate(task, model, objectives, factors, time, moved)


def _evaluate(
    task: Any, model: ArmModel, objectives: Any, factors: np.ndarray, time: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """Return objectives over their ranges, minimised, then all limits as shares of theirs, negative where they hold."""
    motion = measure(model, task, time, q)
    values = [np.array([objective_value(each, motion) for each in objectives]) * factors]
    values += [share.ravel() for share in limit_shares(task, motion).values()]
    values += [np.array([constraint_excess(each, motion)]) for each in task.constraints]
    return np.concatenate(values)


def _best_gain(gains: np.ndarray, limits: np.ndarray, at: np.ndarray, box: float) -> float:
    """Return the most that all rows of ``gains`` fall at once along a direction within the box that keeps limits."""
    bounded = np.isfinite(at) & (at > -np.abs(limits).sum(axis=1) * box)
    directions = gains.shape[1]
    rows = np.block([[gains, np.ones((len(gains), 1))], [limits[bounded], np.zeros((int(bounded.sum()), 1))]])
    right = np.concatenate([np.zeros(len(gains)), np.maximum(-at[bounded] - OPTIONS.tightened, 0.0)])
    cost = np.append(np.zeros(directions), -1.0)
    bounds = [*[(-box, box)] * directions, (0.0, None)]
    result = linprog(cost, A_ub=rows, b_ub=right, bounds=bounds, method="highs")
    return float(-result.fun) if result.status == 0 else float("nan")
