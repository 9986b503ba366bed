"""Certificates by differences: no direction along the self-motion improves all objectives at once.

A point is critical if no direction d on the path lowers all objectives within limits, to first order. This is a linear
program over the box |d| ≤ r inside the unit ball,

    maximise    t
    subject to  gᵢ·d + Σ wₖ eₖ + t ≤ 0      for every objective i
                eₖ ≥ vₖₚ − vₖ + gₖₚ·d       for every piece p of its term k: absolute values, peaks, distances
                c + J d ≤ 0                 for every limit, as a share of its range
                −r ≤ d ≤ r

The value is a lower bound of the criticality χ, and 0 if and only if χ is. Derivatives are central differences of the
definitions. A user's function may have unknown kinks, so the direction found is tried. If objectives do not fall
along it, their gradients there become further pieces, until a better motion is found or no direction is left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import null_space
from scipy.optimize import linprog

from paretoik.front.certificates import STATUSES
from paretoik.inputs import first_line
from paretoik.verification.arm_model import ArmModel
from paretoik.verification.limits import clearance_range, joint_limits, limit_shares
from paretoik.verification.measured_motion import MeasuredMotion, measure
from paretoik.verification.motion_checks import finer_motion, project, project_curve
from paretoik.verification.objectives import Terms, is_own_integral, objective_terms
from paretoik.verification.path_targets import path_targets, task_errors
from paretoik.verification.run_contents import Check, RunContents, demand, judge, leave_out
from paretoik.verification.tolerances import OPTIONS, TOLERANCES

# The table and the arrays of a run, without the problem.


EXCEEDS = "limits exceeded between samples"  # status of an optimum that exceeds limits in spite of tightening


def check_tables(run: RunContents) -> Iterator[Check]:
    """Check ids, objectives, arrays and certificates of a front or a plan."""
    ids, values = run.ids, run.values
    yield demand("ids", len(set(ids.tolist())) == len(ids), "an id is in the table twice")
    declared = run.entries.get("points")
    if declared is not None:
        yield demand("ids", declared == len(ids), f"run.json says {declared} points, but the table has {len(ids)}")
    for each in run.objectives:
        name = str(each.get("name"))
        yield demand(
            "objectives' names", name in run.table, f"run.json names {name!r}, but the table has no such column"
        )
    yield demand("finite values", np.isfinite(values).all(), "an objective in the table is not finite")
    # no point dominates another; the optima of a plan are in order, the best first
    F = values * run.signs
    if run.is_plan:
        exceeds = run.table.get("status", np.zeros(len(F), dtype=np.str_)) == EXCEEDS  # these come last
        in_order = np.array_equal(np.lexsort((F[:, 0], exceeds)), np.arange(len(F)))
        yield demand("order of optima", in_order, "a later optimum is better than the one before")
    else:
        for row, one in enumerate(F):
            better = (one >= F).all(axis=1) & (one > F).any(axis=1)
            by = int(ids[int(better.argmax())])
            yield demand("non-domination", not better.any(), f"point {by} dominates it", point=int(ids[row]))
        for each in run.objectives:
            low, high = (float(side) for side in each.get("range", (np.nan, np.nan)))
            yield demand("ranges", low <= high, f"the range of {each.get('name')} in run.json is not lower ≤ upper")
    yield from _check_arrays(run)
    if not run.is_plan and np.isfinite(run.table.get("criticality", np.nan)).any():
        yield from _check_rates(run)


def _check_arrays(run: RunContents) -> Iterator[Check]:
    arrays = run.motions
    if "q" not in arrays:
        yield leave_out("motions", "the run stores none")
        return
    q, time, joints = (np.asarray(arrays.get(name, np.empty(0))) for name in ("q", "time", "joint_names"))
    stored = np.asarray(arrays.get("id", np.empty(0)))
    yield demand("ids", np.array_equal(stored, run.ids), "motions.npz has other ids than the table")
    fits = q.ndim == 3 and time.shape == q.shape[:2] and joints.shape == q.shape[2:] and len(q) == len(run.ids)
    yield demand("shapes", fits, f"q {q.shape}, time {time.shape} and joint_names {joints.shape} do not match in shape")
    if not fits:
        return
    yield demand("joint names", len(set(joints.tolist())) == len(joints), "a joint is in motions.npz twice")
    for row, number in enumerate(run.ids.tolist()):
        finite = np.isfinite(q[row]).all() and np.isfinite(time[row]).all()
        yield demand("finite motions", finite, "a joint position or a time is not finite", point=number)
        yield demand("times", (np.diff(time[row]) > 0).all(), "times do not increase", point=number)


def _check_rates(run: RunContents) -> Iterator[Check]:
    """Check that exchange rates follow from weights and are in their intervals."""
    arrays, size = run.motions, run.ranges
    for name in ("weights", "exchange_rates", "exchange_intervals"):
        if name not in arrays or len(arrays[name]) != len(run.ids):
            yield demand("certificates", False, f"motions.npz has no {name} for all points")
            return
    for row, number in enumerate(run.ids.tolist()):
        weights = np.asarray(arrays["weights"][row])
        status = str(run.table["status"][row])
        yield demand("certificates", status in STATUSES, f"{status!r} is not a status", point=number)
        if not np.isfinite(weights).all():
            yield leave_out("exchange rates", "no weights were found", point=number)
            continue
        off = max(abs(float(weights.sum()) - 1.0), float(-weights.min()))
        yield judge("weights", off, TOLERANCES.sums, "weights are not positive with the sum 1", point=number)
        rates, intervals = arrays["exchange_rates"][row], arrays["exchange_intervals"][row]
        finite = np.isfinite(rates) & ~np.eye(len(weights), dtype=bool)
        if not finite.any() or (size == 0).any():
            yield leave_out("exchange rates", "a rate has no single value at this point", point=number)
            continue
        natural = weights / size * run.signs
        with np.errstate(divide="ignore", invalid="ignore"):
            expected = -natural[:, None] / natural[None, :]
        scale = np.maximum(np.abs(expected), np.finfo(float).tiny)
        off = float(np.max((np.abs(rates - expected) / scale)[finite]))
        yield judge("exchange rates", off, TOLERANCES.rates, "a rate is not the ratio of the weights", point=number)
        bounded = finite & np.isfinite(intervals).all(axis=-1)
        below, above = intervals[..., 0] - rates, rates - intervals[..., 1]
        off = float(np.max((np.maximum(below, above) / scale)[bounded], initial=0.0))
        yield judge("exchange intervals", off, TOLERANCES.rates, "a rate is outside its interval", point=number)


# Certificates by differences along the self-motion.


SUBJECTS = ("criticality by differences", "weights by differences")
CRITICAL = ("minimum", "saddle", "converged", "under-resolved")  # statuses that claim criticality


def check_certificate(
    run: RunContents, task: Any, model: ArmModel, objectives: Any, row: int, time: np.ndarray, q: np.ndarray
) -> Iterator[Check]:
    """Check the criticality of a point, if claimed, and its weights."""
    point, status = int(run.ids[row]), run.status(row)
    stated = not run.is_plan and "criticality" in run.table
    residual = float(run.table["criticality"][row]) if stated else np.nan
    if status not in CRITICAL and np.isnan(residual):
        return
    if run.is_plan:
        size, weights = np.maximum(np.abs(run.values[row]), np.finfo(float).tiny), np.ones(1)
    else:
        size = np.where(run.ranges > 0, run.ranges, np.maximum(np.abs(run.values[row]), 1.0))
        weights = np.asarray(run.motions["weights"][row]) if "weights" in run.motions else np.full(len(size), np.nan)
        excess = max(residual - TOLERANCES.criticality, 0.0) if status in CRITICAL else 0.0
        yield demand("certificates", not excess, f"{status!r} must have criticality 0, got {residual:.3g}", point=point)
    accepted = TOLERANCES.criticality + (0.0 if status in CRITICAL else max(residual, 0.0))
    known = bool(np.isfinite(weights).all())
    some = weights if known else np.full(len(size), 1.0 / len(size))
    try:
        near = _neighbours(task, model, objectives, run.signs / size, time, q)
        gain, weighted, steepest = _gains(near, some, accepted)
        if gain > accepted and any(is_own_integral(each) for each in objectives):
            kinked = _gains(replace(near, own_kinks=True), some, accepted)
            gain, weighted, steepest = min((gain, weighted, steepest), kinked)
    except Exception as fault:  # a user's function may raise anything
        undecided = isinstance(fault, UndecidedError)
        reason = str(fault) if undecided else f"a function fails here: {first_line(fault)}"
        yield from (leave_out(subject, reason, point=point) for subject in SUBJECTS)
        return
    detail = (
        f"a direction improves all objectives by {gain:.3g} of their ranges; criticality in the table is {residual:.3g}"
    )
    yield judge(SUBJECTS[0], gain, accepted, detail, point=point)
    detail = f"a direction improves the weighted sum by {weighted:.3g} of its range: the weights are wrong"
    if not known:
        yield leave_out(SUBJECTS[1], "no weights were found", point=point)
    elif len(weights) > 1:
        yield judge(SUBJECTS[1], weighted, max(TOLERANCES.weights * steepest, accepted), detail, point=point)
    yield leave_out(
        "curvature", "second derivatives, which tell a minimum from a saddle, are not computed", point=point
    )


class UndecidedError(Exception):
    """Differences cannot decide whether a point is critical; the text has the reason."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """First-order pieces of an objective's terms; if only the largest counts, all belong to one term.

    terms: index (pieces,) of the term of each piece
    values: values (pieces,)
    slopes: gradients (pieces, directions)
    weights: weights of the terms
    """

    terms: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class FirstOrder:
    """Objectives and limits to first order.

    objectives: pieces of each objective
    limits: gradients (limits, directions) of limits
    bounds: values (limits,) of limits, as shares of ranges; ≤ 0 if satisfied
    """

    objectives: tuple[Pieces, ...]
    limits: np.ndarray
    bounds: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Neighbours:
    """Motions on the path near a given motion, by coordinates along the self-motion.

    samples: samples that may move
    frames: directions (samples, redundancy, dof) of self-motion
    factors: factors (n_obj,) of objectives, 1 / size, negative for maximised objectives
    own_kinks: whether users' integrals have kinks
    """

    task: Any
    model: ArmModel
    objectives: Any
    factors: np.ndarray
    time: np.ndarray
    q: np.ndarray
    samples: np.ndarray
    frames: np.ndarray
    own_kinks: bool = False

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.frames.shape[0] * self.frames.shape[1]

    def move(self, d: np.ndarray) -> np.ndarray:
        """Return the motion at coordinates, projected onto the path."""
        shares = d.reshape(self.frames.shape[:2])
        moved = self.q.copy()
        touched = np.flatnonzero(np.abs(shares).max(axis=1) > 0)
        place = self.samples[touched]
        moved[place] += np.einsum("sr,srj->sj", shares[touched], self.frames[touched])
        moved[place] = project(self.model, self.task.tasks, moved[place], self.time[place])[0]
        if self.task.cyclic:
            moved[-1] = moved[0]
        if self.task.ties_end:
            moved[-1] = project(self.model, self.task.tasks, moved[-2:-1], self.time[-1:], self.q[-1:])[0][0]
        return moved

    def terms(self, d: np.ndarray) -> list[Terms]:
        """Return the objectives of the motion at coordinates, and last its limits."""
        motion = measure(self.model, self.task, self.time, self.move(d))
        pairs = zip(self.objectives, self.factors, strict=True)
        terms = [objective_terms(each, motion, factor, own_kinks=self.own_kinks) for each, factor in pairs]
        return [*terms, _limit_terms(self.task, motion)]

    def limits_between(self, d: np.ndarray) -> np.ndarray:
        """Return all limits at coordinates on the finer grid, as shares of their ranges."""
        curve = project_curve(self.task, self.model, self.time, self.move(d))
        return _limit_terms(self.task, finer_motion(self.task, self.model, curve, self.time)).pieces.ravel()


def _gains(near: Neighbours, weights: np.ndarray, accepted: float) -> tuple[float, float, float]:
    """Return the gains of all objectives at once, of their weighted sum, and of the steepest objective."""
    box = 1.0 / np.sqrt(near.frames.shape[1])
    gain, at = _shown_gain(near, _linearise(near, np.zeros(near.size)), box, accepted)
    weighted = gain if len(weights) == 1 else _best_gain(at, box, weights[None])[0]
    free = replace(at, limits=at.limits[:0], bounds=at.bounds[:0])
    steepest = max(_best_gain(free, box, row[None])[0] for row in np.eye(len(weights)))
    return gain, weighted, steepest


def _neighbours(
    task: Any, model: ArmModel, objectives: Any, factors: np.ndarray, time: np.ndarray, q: np.ndarray
) -> Neighbours:
    """Return the motions near a given one; raises UndecidedError if its end at rest is not the nearest posture."""
    targets = path_targets(task.tasks, time)
    jacobians = [task_errors(model, targets, q[k], k)[1] for k in range(len(time))]
    frames = [(null_space(jacobian * model.scales) * model.scales[:, None]).T for jacobian in jacobians]
    redundancy = min(len(frame) for frame in frames)
    first, last = int(task.start is not None), len(time) - int(task.cyclic or task.ties_end)
    samples = np.arange(first, last)
    near = Neighbours(
        task=task,
        model=model,
        objectives=objectives,
        factors=factors,
        time=time,
        q=q,
        samples=samples,
        frames=np.array([frames[k][:redundancy] for k in samples]),
    )
    if task.ties_end and np.abs(near.move(np.zeros(near.size))[-1] - q[-1]).max() > TOLERANCES.on_path:
        raise UndecidedError("its end at rest is not the nearest posture to the one before")
    return near


def _linearise(near: Neighbours, d: np.ndarray) -> FirstOrder:
    """Return objectives and limits to first order at coordinates d, by central differences.

    Terms of an instant depend only on samples near it, so samples far apart are moved at once. If the result does not
    predict the change in a random direction, samples are moved one by one. Raises UndecidedError at a concave kink.
    """
    terms = near.terms(d)
    instants = np.concatenate([np.tile(each.instants, len(each.pieces)) for each in terms])
    middle = _flat(terms)
    for spacing in (OPTIONS.spacing, len(near.time)):
        if spacing < len(near.time) and (instants < 0).any():
            continue
        slopes, bend = _slopes(near, d, middle, instants, spacing)
        if spacing >= len(near.time):
            break
        u = np.random.default_rng(0).uniform(-1.0, 1.0, near.size)
        ahead, back = (_flat(near.terms(d + sign * OPTIONS.step * u)) for sign in (1.0, -1.0))
        seen = (ahead - back) / (2 * OPTIONS.step)
        foreseen = slopes @ u
        if (np.abs(seen - foreseen) <= OPTIONS.foreseen * (np.abs(slopes) @ np.abs(u)) + OPTIONS.foreseen).all():
            break
    objectives, first = [], 0
    for each in terms[:-1]:
        rows = slice(first, first + each.pieces.size)
        first = rows.stop
        if len(each.pieces) == 1 and (bend[rows] < -OPTIONS.kink * np.abs(slopes[rows]).max(axis=1)).any():
            nearer = _slopes(near, d, middle, instants, spacing, OPTIONS.step / 10)[1]
            if (nearer[rows] < np.minimum(bend[rows] / 2, -OPTIONS.kink * np.abs(slopes[rows]).max(axis=1))).any():
                raise UndecidedError("an objective has a concave kink there")
        numbers = np.tile(np.arange(each.pieces.shape[1]), len(each.pieces))
        numbers, weights = (0 * numbers, np.ones(1)) if each.weights is None else (numbers, each.weights)
        objectives.append(Pieces(terms=numbers, values=each.pieces.ravel(), slopes=slopes[rows], weights=weights))
    finite = np.isfinite(middle[first:])
    return FirstOrder(objectives=tuple(objectives), limits=slopes[first:][finite], bounds=middle[first:][finite])


def _slopes(
    near: Neighbours, d: np.ndarray, middle: np.ndarray, instants: np.ndarray, spacing: int, step: float = OPTIONS.step
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives (values, coordinates), and the least curvature (values,) along any coordinate."""
    count, redundancy = near.frames.shape[:2]
    stride = 2 if near.task.differences == "spline" else 1
    cycle = len(near.time) - 1 if near.task.cyclic else 0
    if cycle:
        spacing = next(s for s in range(min(spacing, cycle), cycle + 1) if cycle % s == 0)
    slopes, bend = np.zeros((len(middle), count, redundancy)), np.zeros(len(middle))
    for color in range(min(spacing, count)):
        members = np.arange(color, count, spacing)
        away = np.abs(instants[:, None] / stride - near.samples[members])
        away = np.minimum(away, np.abs(cycle - away)) if cycle else away
        owner = members[away.argmin(axis=1)]
        for k in range(redundancy):
            by = np.zeros((count, redundancy))
            by[members, k] = step
            ahead, back = (_flat(near.terms(d + sign * by.ravel())) for sign in (1.0, -1.0))
            with np.errstate(invalid="ignore"):
                slopes[np.arange(len(middle)), owner, k] = (ahead - back) / (2 * step)
                bend = np.fmin(bend, (ahead - 2 * middle + back) / step)
    return slopes.reshape(len(middle), -1), bend


def _flat(terms: Sequence[Terms]) -> np.ndarray:
    return np.concatenate([each.pieces.ravel() for each in terms])


def _limit_terms(task: Any, motion: MeasuredMotion) -> Terms:
    """Return all limits as shares of their ranges, negative if satisfied, −inf without a limit."""
    count = motion.time.shape[1]
    shares = [limit_shares(values, limits, size) for _, values, limits, size in joint_limits(task, motion)]
    if task.obstacles:
        distances = motion.pair_clearances.reshape(count, -1)
        shares.append((task.min_clearance - distances) / clearance_range(task, motion.model))
    whole = list[float]()
    for each in task.constraints:
        values = np.asarray(each.function(motion), dtype=float)
        values = motion.integral(values) if each.form == "integral" else values.reshape(-1)
        sides = np.stack([values - each.upper, each.lower - values], axis=-1) / each.scale
        if each.form == "peak":
            shares.append(sides)
        else:
            whole += sides.ravel().tolist()
    local = np.concatenate([share.ravel() for share in shares]) if shares else np.zeros(0)
    instants = [np.repeat(np.arange(count), share.shape[1]) for share in shares]
    return Terms(
        pieces=np.append(local, whole)[None],
        instants=np.concatenate([*instants, np.full(len(whole), -1)]).astype(int),
        weights=None,
    )


def _totals(terms: Sequence[Terms]) -> np.ndarray:
    """Return the values of objectives (n_obj,), which are all terms but the last, the limits."""
    largest = [(each.pieces.max(axis=0), each.weights) for each in terms[:-1]]
    return np.array([values.max() if weights is None else values @ weights for values, weights in largest])


def _shown_gain(near: Neighbours, at: FirstOrder, box: float, accepted: float) -> tuple[float, FirstOrder]:
    """Return the first-order gain of all objectives at once, and its linearisation.

    A gain above ``accepted`` is returned only if a motion along its direction confirms it: all objectives fall with at
    least half of the predicted slope, and no limit is exceeded more than at the start, at instants or between them.
    Raises UndecidedError if kinks or limits between samples make the result uncertain.
    """
    task, origin = near.task, np.zeros(near.size)
    start, between = _totals(near.terms(origin)), np.zeros(0)
    if task.differences == "spline" and (task.bounds or task.obstacles or task.constraints):
        # Refined motions satisfy limits between samples too: limits with a small slack after refinement are active.
        between = np.maximum(near.limits_between(origin), -TOLERANCES.tightened)
    reason = ""
    for _ in range(OPTIONS.rounds):
        gain, d = _best_gain(at, box, np.eye(len(at.objectives)))
        if gain <= accepted:
            return gain, at
        for step in OPTIONS.trials:
            there = near.terms(step * d)
            far, half = _totals(there), _totals(near.terms(step / 2 * d))
            # gradients at the start, without curvature
            falls = ((4 * half - far - 3 * start) / step).max() <= -gain / 2
            kept = there[-1].pieces.max(initial=0.0) <= max(at.bounds.max(initial=0.0), 0.0) + TOLERANCES.limits
            if falls and kept:
                if not len(between) or (near.limits_between(step * d) <= between + TOLERANCES.limits).all():
                    return gain, at
                reason = "a direction improves all objectives, but comes nearer to limits between samples"
        if reason:
            raise UndecidedError(reason)
        # further pieces: those of the motion on the other side of kinks whose gradients differ
        pairs, widened = zip(at.objectives, _linearise(near, OPTIONS.probe * d).objectives, strict=True), list[Pieces]()
        for one, other in pairs:
            values, own = other.values - other.slopes @ (OPTIONS.probe * d), one.slopes[: len(other.slopes)]
            rows = np.abs(other.slopes - own).max(axis=1) > OPTIONS.kink * np.abs(own).max(axis=1)
            values = np.append(one.values, np.minimum(values, one.values[: len(values)])[rows])
            slopes = np.concatenate([one.slopes, other.slopes[rows]])
            terms = np.append(one.terms, other.terms[rows])
            widened.append(Pieces(terms=terms, values=values, slopes=slopes, weights=one.weights))
        at = replace(at, objectives=tuple(widened))
    raise UndecidedError("undecided, because an objective has kinks")


def _best_gain(at: FirstOrder, box: float, mixtures: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the largest gain that weighted sums (rows, n_obj) of objectives share, and its direction in the box."""
    n_obj, directions = len(at.objectives), at.limits.shape[1]
    linear, rows, right, columns = np.zeros((n_obj, directions)), [np.zeros((0, directions))], [], list[int]()
    epigraphs = list[np.ndarray]()  # for each e: its weights in the objectives (n_obj,)
    for i, each in enumerate(at.objectives):
        terms, weights = each.terms, each.weights
        order = np.lexsort((-each.values, terms))
        heads = order[np.unique(terms[order], return_index=True)[1]]  # the largest piece of each term
        head = np.empty(len(weights), dtype=int)
        head[terms[heads]] = heads
        lengths = np.abs(each.slopes).sum(axis=1)
        slack = each.values[head[terms]] - each.values
        reached = (slack <= box * (lengths + lengths[head[terms]])) & (weights[terms] > 0)
        several = np.bincount(terms[reached], minlength=len(weights)) > 1
        smooth = head[~several]
        linear[i] = weights[terms[smooth]] @ each.slopes[smooth]
        for term in np.flatnonzero(several):
            members = np.flatnonzero(reached & (terms == term))
            rows.append(each.slopes[members])
            right.append(slack[members])
            columns += [len(epigraphs)] * len(members)
            epigraphs.append(weights[term] * np.eye(n_obj)[i])
    count, ties = len(epigraphs), len(columns)
    table = np.array(epigraphs).reshape(count, n_obj).T
    bounded = at.bounds > -np.abs(at.limits).sum(axis=1) * box
    shares = [sparse.csr_array(mixtures @ linear), sparse.csr_array(mixtures @ table), np.ones((len(mixtures), 1))]
    epigraph = sparse.csr_array((-np.ones(ties), (np.arange(ties), columns)), shape=(ties, count))
    pieces, limited = sparse.csr_array(np.concatenate(rows)), sparse.csr_array(at.limits[bounded])
    matrix = sparse.block_array([shares, [pieces, epigraph, None], [limited, None, None]], format="csr")
    slacks = np.maximum(-at.bounds[bounded] - TOLERANCES.tightened, 0.0)
    upper = np.concatenate([np.zeros(len(mixtures)), *right, slacks])
    cost = np.zeros(directions + count + 1)
    cost[-1] = -1.0
    limits = [*[(-box, box)] * directions, *[(None, None)] * count, (0.0, None)]
    result = linprog(cost, A_ub=matrix, b_ub=upper, bounds=limits, method="highs")
    if result.status != 0:
        raise UndecidedError(f"the linear program of its gain ends with: {result.message}")
    return float(-result.fun), np.asarray(result.x[:directions])
