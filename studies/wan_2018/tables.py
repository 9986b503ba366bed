"""Tables 2 and 3: errors, limits and steps, which method errs less, and times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

import paretoik as pk
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.resolution.step_kernels import clamping_weight
from problems.wan_2018 import BUFFER
from studies.reporting import Row, tell
from studies.wan_2018.methods import (
    AXES,
    VARIANTS,
    Resolved,
    all_methods,
    axis_errors,
    cut_short,
    error_distances,
    paper,
    paper_methods,
    paper_name,
    path_of,
    resolve_from,
    start_postures,
    worst_errors,
)

FOURTH = 3  # joint 4, counted from 0
EVENTS_TITLE = "events of the figures, medians over starts"
AT_LIMIT = 0.02  # share of its range: a joint nearer to a limit than this is at it
READINGS = ("ZYZ", "ZXZ", "ZYX", "XYZ", "zyx", "xyz")  # axes of Euler angles; capitals are intrinsic
REASONS = {
    "Table 2": "the paper prints no start: these are all over the first pose's self-motion",
    "Table 3": "no start and no Euler angles are printed; by ZYZ few motions of GPM are singular (rows below)",
}
MACHINE = "ours is compiled code on today's processor, theirs MATLAB and LabVIEW on a Core i3 of 1.8 GHz"
WORK = {
    "Table 2": "weights and repulsion come on top of the same matrix products: they add work and save none",
    "Table 3": "of two criteria one is left, which saves its gradient; weights and repulsion cost less",
}


def table_rows(resolved: Resolved) -> list[Row]:
    """Return medians over starts of the greatest errors, results on limits, and which method errs less."""
    rows = [row for name in resolved.motions for row in _error_rows(resolved, name)]
    rows += [row for name, motion in resolved.motions.items() for row in _limit_rows(resolved.table, name, motion)]
    first, title = resolved.baseline, f"{resolved.table}: which errs less, from the same start"
    errors = {name: worst_errors(motion).max(axis=1) for name, motion in resolved.motions.items()}
    for name in (name for name in errors if name != first):
        place = title, f"{name} beside {first}", "less on its worst axis", "share of starts"
        rows.append(Row(*place, float((errors[name] < errors[first]).mean())))
    return rows


def _error_rows(resolved: Resolved, name: str) -> list[Row]:
    errors = worst_errors(resolved.motions[name])
    rows = []
    for (axis, unit), column in zip(AXES.items(), errors.T, strict=True):
        low, middle, high = np.quantile(column, [0.25, 0.5, 0.75])
        printed = paper().get((resolved.table, axis, paper_name(name)))
        note = f"quartiles {low:.2g} and {high:.2g}" + (f"; {REASONS[resolved.table]}" if printed else "")
        table = f"{resolved.table}: greatest errors, medians over {len(errors)} starts"
        rows.append(Row(table, axis, name, unit, float(middle), reference=printed, note=note))
    return rows


def euler_rows(table: str, *, population: int) -> list[Row]:
    """Return how near the baseline's errors come to print, by the axes of the Euler angles.

    Also the share of its motions that a singular posture damps: the paper's is damped.
    """
    method = next(iter(paper_methods(table)))
    rows = []
    for euler in READINGS:
        path = path_of(table, euler)
        try:
            starts = start_postures(path, population)
        except pk.Infeasible:
            continue
        motion = resolve_from(table, method, starts, euler)
        damped = (motion.traces.damping > 0).any(axis=1).mean()
        title, sense = (
            f"{table}: Euler angles, which the paper does not name",
            "intrinsic" if euler.isupper() else "extrinsic",
        )
        column = f"{method}: distance of the nearest start's errors from those printed"
        value = float(error_distances(table, method, motion).min())
        note = f"in logarithms, of 6 axes; {len(starts)} starts; {damped:.0%} of motions are damped in some step"
        rows.append(Row(title, f"{euler}, {sense}", column, "", value, note=note))
    return rows


def _limit_rows(table: str, name: str, motion: ResolvedMotion) -> list[Row]:
    lower, upper = motion.arm.position_limits.T
    margin = np.minimum(motion.q - lower, upper - motion.q) / (upper - lower)
    fastest = (np.abs(motion.dq) / motion.arm.velocity_limits).max(axis=(1, 2))
    shares = {
        "joint 4 ends at a limit": (margin[:, -1, FOURTH] < AT_LIMIT, f"within {AT_LIMIT:.0%} of its range"),
        "positions keep their limits": (margin.min(axis=(1, 2)) > -1e-9, ""),
        "velocities keep theirs": (fastest < 1 + 1e-9, f"median of the highest {np.median(fastest):.3g} limits"),
        "some step cut short": (cut_short(motion), "a joint were to turn by more than 1 rad, or posture singular"),
        "limits leave no way on": (
            (motion.traces.status == "limited").any(axis=1),
            "in some step; the paper's methods do not ask",
        ),
    }
    title, unit = f"{table}: what becomes of limits, and of steps", "share of starts"
    return [Row(title, name, column, unit, float(share.mean()), note=note) for column, (share, note) in shares.items()]


def running_time_rows(resolved: Resolved, *, rounds: int) -> list[Row]:
    """Return the seconds of one motion by every method, from the start nearest to the paper's."""
    table, path, arm = resolved.table, path_of(resolved.table), pk.arms.wan_7r()
    start = resolved.motions[resolved.baseline].q[resolved.nearest_start(), 0]
    calls = {
        name: partial(pk.resolve, arm, path, method, start=start, limits=limits, unreachable="track")
        for name, (method, limits) in all_methods(table).items()
    }
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(rounds + 1):  # alternating; the first is not counted
        tell(f"times of {len(calls)} calls, round {turn} of {rounds}")
        for name, call in calls.items():
            clock = time.perf_counter()
            call()
            taken[name].append(time.perf_counter() - clock)
    elapsed = {name: float(np.median(seconds[1:])) for name, seconds in taken.items()}
    printed = {name: paper().get((table, "running time", paper_name(name))) for name in elapsed}

    def row(name: str, column: str, unit: str, ours: float, reference: float | None, note: str) -> Row:
        title = f"{table}: running time of one motion, {len(path.times)} samples, median of {rounds}"
        return Row(title, name, column, unit, ours, reference=reference, note=note)

    rows = [
        row(name, "time", "s", seconds, printed[name], MACHINE if printed[name] else "a program in each limited step")
        for name, seconds in elapsed.items()
    ]
    first = resolved.baseline
    for name, theirs in printed.items():
        if theirs and name != first:
            ratios = elapsed[name] / elapsed[first], theirs / (printed[first] or np.nan)
            rows.append(row(name, f"time over {first}'s", "", *ratios, WORK[table]))
    return rows


SECOND = 1  # joint 2, counted from 0
UNKNOWN_START = "no start is printed, and a duration that fits these times is ours"
IN_REACH = "no start and no Euler angles are printed; by ZYZ few motions of GPM are singular (rows below)"
BUFFERS = "no start is printed; from most of ours a joint is in its buffer, which lowers the singular values"


def first_damped(motion: ResolvedMotion) -> np.ndarray:
    """Return the time (motions,) of the first damped step [s]; NaN without one."""
    damped = motion.traces.damping > 0
    return np.where(damped.any(axis=1), motion.time[..., 0, :][damped.argmax(axis=1)], np.nan)


def last_damped(motion: ResolvedMotion) -> np.ndarray:
    """Return the time (motions,) of the last damped step [s]; NaN without one."""
    damped = motion.traces.damping[:, ::-1] > 0
    return np.where(damped.any(axis=1), motion.time[..., 0, :][:-1][::-1][damped.argmax(axis=1)], np.nan)


def worst_position(motion: ResolvedMotion) -> np.ndarray:
    """Return the time (motions,) of the greatest position error [s]."""
    return np.asarray(motion.time[0][np.linalg.norm(axis_errors(motion)[..., :3], axis=-1).argmax(axis=1)])


def nearest_limit(motion: ResolvedMotion) -> np.ndarray:
    """Return the time (motions,) at which joint 2 is nearest to a position limit [s]."""
    lower, upper = motion.arm.position_limits[SECOND]
    q = motion.q[..., SECOND]
    return np.asarray(motion.time[0][np.minimum(q - lower, upper - q).argmin(axis=1)])


def greatest_jump(motion: ResolvedMotion) -> np.ndarray:
    """Return the time (motions,) of the largest velocity change of a joint, relative to its limit [s]."""
    jumps = np.abs(np.diff(motion.traces.velocities, axis=1)) / motion.arm.velocity_limits
    return np.asarray(motion.time[0][1 + jumps.max(axis=2).argmax(axis=1)])


def least_weight(motion: ResolvedMotion) -> np.ndarray:
    """Return the least clamping weight (motions,) of joint 2."""
    return np.asarray(motion.traces.weights[..., SECOND].min(axis=1))


class Event(NamedTuple):
    """An event of a figure, its measure, and why ours differs."""

    figure: str
    column: str
    measure: Callable[[ResolvedMotion], np.ndarray]
    reason: str


EVENTS = {
    "WLN": (
        Event("Figure 6", "first damped step", first_damped, UNKNOWN_START),
        Event("Figure 6", "greatest position error", worst_position, UNKNOWN_START),
    ),
    "GPM": (
        Event("Figure 10", "joint 2 nearest its limit", nearest_limit, IN_REACH),
        Event("Figure 10", "greatest jump of velocities", greatest_jump, IN_REACH),
    ),
    "WGPM": (
        Event("Figure 11", "joint 2 nearest its limit", nearest_limit, IN_REACH),
        Event("Figure 11", "least weight of joint 2", least_weight, ""),
        Event("Figure 11", "first damped step", first_damped, BUFFERS),
        Event("Figure 11", "last damped step", last_damped, BUFFERS),
    ),
}


def event_rows(tables: Sequence[Resolved]) -> list[Row]:
    """Return medians over starts, the numbers from the start nearest to the paper's, and the printed ones."""
    rows = []
    for resolved in tables:
        for name, motion in resolved.motions.items():
            method = "WGPM" if name in VARIANTS and resolved.table == "Table 3" else name
            for event in EVENTS.get(method, ()):
                values = event.measure(motion)
                rows.append(_row(event, name, method, values, resolved.nearest_start()))
        if resolved.table == "Table 2":
            first = first_damped(resolved.motions[resolved.baseline])
            note = (
                "the paper: it is later; a joint in its buffer lowers the clamped Jacobian's singular values from the "
            )
            note += "first sample on"
            for name in VARIANTS:
                later = float((np.nan_to_num(first_damped(resolved.motions[name]), nan=np.inf) > first).mean())
                place = EVENTS_TITLE, f"Figure 7, {name}", f"singular later than by {resolved.baseline}"
                rows.append(Row(*place, "share of starts", later, note=note))
    return rows


def _row(event: Event, name: str, method: str, values: np.ndarray, nearest: int) -> Row:
    printed = paper()[event.figure, event.column, method]
    reason = _depth_of_weight(printed) if event.measure is least_weight else event.reason
    happens = values[np.isfinite(values)]
    low, middle, high = np.quantile(happens, [0.25, 0.5, 0.75]) if len(happens) else (np.nan,) * 3
    note = (
        f"quartiles {low:.3g} and {high:.3g}, in {len(happens) / len(values):.0%} of motions, in those drawn "
        f"{values[nearest]:.3g}; {reason}"
    )
    unit = "" if event.measure is least_weight else "s"
    return Row(EVENTS_TITLE, f"{event.figure}, {name}", event.column, unit, float(middle), reference=printed, note=note)


def _depth_of_weight(weight: float) -> str:
    """Return in words the depth in its buffer at which a joint has a clamping weight."""
    depth = float(brentq(lambda d: clamping_weight(d) - weight, 0.01, 0.99))
    return (
        f"{weight} is that of a joint {depth:.0%} deep in its buffer, {BUFFER * (1 - depth):.0%} of its range from the "
        "limit; no start is printed, and from ours it goes nearer, or not into its buffer"
    )
