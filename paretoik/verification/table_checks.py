"""The table and the arrays of a run by themselves, without the problem."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from paretoik.front.certificates import STATUSES
from paretoik.verification.options import TOLERANCES
from paretoik.verification.report import Check, demand, judge, leave_out
from paretoik.verification.run_contents import RunContents

EXCEEDS = "limits exceeded between samples"  # status of an optimum that no tightening brings within its limits


def check_tables(run: RunContents) -> Iterator[Check]:
    """Check ids, objectives, arrays and certificates of a front or a plan."""
    ids, values = run.ids, run.values
    yield demand("ids", len(set(ids.tolist())) == len(ids), "an id stands in the table twice")
    declared = run.entries.get("points")
    if declared is not None:
        yield demand("ids", declared == len(ids), f"run.json says {declared} points, the table has {len(ids)}")
    for each in run.objectives:
        name = str(each.get("name"))
        yield demand("objectives' names", name in run.table, f"run.json names {name!r}, the table has no such column")
    yield demand("finite values", np.isfinite(values).all(), "an objective in the table is no finite number")
    yield from _check_order(run, values)
    yield from _check_arrays(run)
    if "objective" not in run.entries and np.isfinite(run.table.get("criticality", np.nan)).any():
        yield from _check_rates(run)


def _check_order(run: RunContents, values: np.ndarray) -> Iterator[Check]:
    """Check that no point dominates another; of a plan, that the best comes first."""
    signs = np.array([-1.0 if each.get("maximised") else 1.0 for each in run.objectives])
    F = values * signs
    if "objective" in run.entries:
        exceeds = run.table.get("status", np.zeros(len(F), dtype=np.str_)) == EXCEEDS  # these come last
        in_order = np.array_equal(np.lexsort((F[:, 0], exceeds)), np.arange(len(F)))
        yield demand("order of optima", in_order, "a later optimum is better than the one before")
        return
    for row, one in enumerate(F):
        better = (one >= F).all(axis=1) & (one > F).any(axis=1)
        by = int(run.ids[int(better.argmax())])
        yield demand("non-domination", not better.any(), f"point {by} dominates it", point=int(run.ids[row]))
    for each in run.objectives:
        low, high = (float(side) for side in each.get("range", (np.nan, np.nan)))
        yield demand("ranges", low <= high, f"the range of {each.get('name')} in run.json is no range")


def _check_arrays(run: RunContents) -> Iterator[Check]:
    arrays = run.motions
    if "q" not in arrays:
        yield leave_out("motions", "the run stores none")
        return
    q, time, joints = (np.asarray(arrays.get(name, np.empty(0))) for name in ("q", "time", "joint_names"))
    stored = np.asarray(arrays.get("id", np.empty(0)))
    yield demand("ids", np.array_equal(stored, run.ids), "motions.npz has other ids than the table")
    fits = q.ndim == 3 and time.shape == q.shape[:2] and joints.shape == q.shape[2:] and len(q) == len(run.ids)
    yield demand(
        "shapes", fits, f"q {q.shape}, time {time.shape} and joint_names {joints.shape} do not belong together"
    )
    if not fits:
        return
    yield demand("joint names", len(set(joints.tolist())) == len(joints), "a joint stands in motions.npz twice")
    for row, number in enumerate(run.ids.tolist()):
        finite = np.isfinite(q[row]).all() and np.isfinite(time[row]).all()
        yield demand("finite motions", finite, "a joint position or a time is no finite number", point=number)
        yield demand("times", (np.diff(time[row]) > 0).all(), "times do not increase", point=number)


def _check_rates(run: RunContents) -> Iterator[Check]:
    """Check that exchange rates follow from the weights, and lie in their intervals."""
    arrays, objectives = run.motions, run.objectives
    for name in ("weights", "exchange_rates", "exchange_intervals"):
        if name not in arrays or len(arrays[name]) != len(run.ids):
            yield demand("certificates", False, f"motions.npz has no {name} of all points")
            return
    size = certified_ranges(run)
    signs = np.array([-1.0 if each.get("maximised") else 1.0 for each in objectives])
    for row, number in enumerate(run.ids.tolist()):
        weights = np.asarray(arrays["weights"][row])
        status = str(run.table["status"][row])
        yield demand("certificates", status in STATUSES, f"{status!r} is no status", point=number)
        if not np.isfinite(weights).all():
            yield leave_out("exchange rates", "no weights were found", point=number)
            continue
        off = max(abs(float(weights.sum()) - 1.0), float(-weights.min()))
        yield judge("weights", off, TOLERANCES.sums, "weights are not positive with the sum 1", point=number)
        rates, intervals = arrays["exchange_rates"][row], arrays["exchange_intervals"][row]
        finite = np.isfinite(rates) & ~np.eye(len(weights), dtype=bool)
        if not finite.any() or (size == 0).any():
            yield leave_out("exchange rates", "a rate has no single value there", point=number)
            continue
        natural = weights / size * signs
        with np.errstate(divide="ignore", invalid="ignore"):
            expected = -natural[:, None] / natural[None, :]
        scale = np.maximum(np.abs(expected), np.finfo(float).tiny)
        off = float(np.max((np.abs(rates - expected) / scale)[finite]))
        yield judge("exchange rates", off, TOLERANCES.rates, "a rate is not the ratio of the weights", point=number)
        bounded = finite & np.isfinite(intervals).all(axis=-1)
        below, above = intervals[..., 0] - rates, rates - intervals[..., 1]
        off = float(np.max((np.maximum(below, above) / scale)[bounded], initial=0.0))
        yield judge("exchange intervals", off, TOLERANCES.rates, "a rate is outside its interval", point=number)


def certified_ranges(run: RunContents) -> np.ndarray:
    """Return the ranges (n_obj,) that the weights of a run are over."""
    return np.array([float(each["range"][1]) - float(each["range"][0]) for each in run.objectives])
