"""Tables 2 and 3: errors, limits and steps, which method errs less, and times."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

import paretoik as pk
from paretoik.resolution.protocol import ResolvedMotion
from problems import wan_2018
from studies.reporting import Row, tell
from studies.wan_2018.methods import (
    AXES,
    Resolved,
    all_methods,
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
AT_LIMIT = 0.02  # share of its range: a joint nearer to a limit than this is at it
FOLLOWED = 1e-3  # m, rad: errors of a motion that follows its path
READINGS = ("ZYZ", "ZXZ", "ZYX", "XYZ", "zyx", "xyz")  # axes of Euler angles; capitals are intrinsic
SETS, GOAL = 200, 0.3  # parameter sets, and seconds for all of them
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
    rows += [row for name in resolved.motions for row in _nearest_start_rows(resolved, name)]
    rows += [row for name, motion in resolved.motions.items() for row in _limit_rows(resolved.table, name, motion)]
    return rows + _comparison_rows(resolved)


def _error_rows(resolved: Resolved, name: str) -> list[Row]:
    errors = worst_errors(resolved.motions[name])
    rows = []
    for (axis, unit), column in zip(AXES.items(), errors.T, strict=True):
        low, middle, high = np.quantile(column, [0.25, 0.5, 0.75])
        printed = paper().get((resolved.table, axis, paper_name(name)))
        rows.append(
            Row(
                table=f"{resolved.table}: greatest errors, medians over {len(errors)} starts",
                row=axis,
                column=name,
                unit=unit,
                ours=float(middle),
                reference=printed,
                note=f"quartiles {low:.2g} and {high:.2g}" + (f"; {REASONS[resolved.table]}" if printed else ""),
            )
        )
    return rows


def _nearest_start_rows(resolved: Resolved, name: str) -> list[Row]:
    """Return the greatest errors from the start with the baseline's nearest to print."""
    errors = worst_errors(resolved.motions[name])[resolved.nearest_start()]
    return [
        Row(
            table=f"{resolved.table}: greatest errors from the start nearest to the paper's",
            row=axis,
            column=name,
            unit=unit,
            ours=float(error),
            reference=paper().get((resolved.table, axis, paper_name(name))),
            note=f"the start is chosen by the errors of {resolved.baseline}, the figures are drawn from it",
        )
        for (axis, unit), error in zip(AXES.items(), errors, strict=True)
    ]


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
        rows.append(
            Row(
                table=f"{table}: Euler angles, which the paper does not name",
                row=f"{euler}, {'intrinsic' if euler.isupper() else 'extrinsic'}",
                column=f"{method}: distance of the nearest start's errors from those printed",
                unit="",
                ours=float(error_distances(table, method, motion).min()),
                note=f"in logarithms, of 6 axes; {len(starts)} starts; {damped:.0%} of motions are damped in some step",
            )
        )
    return rows


def _limit_rows(table: str, name: str, motion: ResolvedMotion) -> list[Row]:
    lower, upper = motion.arm.position_limits.T
    margin = np.minimum(motion.q - lower, upper - motion.q) / (upper - lower)
    at_limit = margin[..., FOURTH] < AT_LIMIT
    fastest = (np.abs(motion.dq) / motion.arm.velocity_limits).max(axis=(1, 2))
    shares = {
        "joint 4 comes to a limit": (at_limit.any(axis=1), f"within {AT_LIMIT:.0%} of its range"),
        "joint 4 ends there": (at_limit[:, -1], "those that came there and do not end there were freed"),
        "positions keep their limits": (margin.min(axis=(1, 2)) > -1e-9, ""),
        "velocities keep theirs": (fastest < 1 + 1e-9, f"median of the highest {np.median(fastest):.3g} limits"),
        "follows the path": (worst_errors(motion).max(axis=1) < FOLLOWED, f"errors below {FOLLOWED:g} m and rad"),
        "some step damped": ((motion.traces.damping > 0).any(axis=1), ""),
        "some step cut short": (cut_short(motion), "a joint were to turn by more than 1 rad, or posture singular"),
        "limits leave no way on": (
            (motion.traces.status == "limited").any(axis=1),
            "in some step; the paper's methods do not ask",
        ),
    }
    return [
        Row(
            table=f"{table}: what becomes of limits, and of steps",
            row=name,
            column=column,
            unit="share of starts",
            ours=float(share.mean()),
            note=note,
        )
        for column, (share, note) in shares.items()
    ]


def _comparison_rows(resolved: Resolved) -> list[Row]:
    first = resolved.baseline
    errors = {name: worst_errors(motion) for name, motion in resolved.motions.items()}
    return [
        Row(
            table=f"{resolved.table}: which errs less, from the same start",
            row=f"{name} beside {first}",
            column="less on its worst axis",
            unit="share of starts",
            ours=float((errors[name].max(axis=1) < errors[first].max(axis=1)).mean()),
            note="; ".join(
                f"{axis} {(errors[name][:, k] < errors[first][:, k]).mean():.0%}" for k, axis in enumerate(AXES)
            ),
        )
        for name in errors
        if name != first
    ]


def running_time_rows(resolved: Resolved, *, rounds: int) -> list[Row]:
    """Return the seconds of one motion by every method, from the start nearest to the paper's."""
    table, path, arm = resolved.table, path_of(resolved.table), pk.arms.wan_7r()
    start = resolved.motions[resolved.baseline].q[resolved.nearest_start(), 0]
    calls = {
        name: partial(pk.resolve, arm, path, method, start=start, limits=limits, unreachable="track")
        for name, (method, limits) in all_methods(table).items()
    }
    elapsed = {name: float(np.median(seconds)) for name, seconds in _seconds(calls, rounds).items()}
    printed = {name: paper().get((table, "running time", paper_name(name))) for name in elapsed}

    def row(name: str, column: str, unit: str, ours: float, reference: float | None, note: str) -> Row:
        title = f"{table}: running time of one motion, {len(path.times)} samples, median of {rounds}"
        return Row(table=title, row=name, column=column, unit=unit, ours=ours, reference=reference, note=note)

    rows = [
        row(name, "time", "s", seconds, printed[name], MACHINE if printed[name] else "a program in each limited step")
        for name, seconds in elapsed.items()
    ]
    first = resolved.baseline
    return rows + [
        row(
            name,
            f"time over {first}'s",
            "",
            elapsed[name] / elapsed[first],
            theirs / (printed[first] or np.nan),
            WORK[table],
        )
        for name, theirs in printed.items()
        if theirs and name != first
    ]


def speed_row(*, rounds: int) -> Row:
    """Return the seconds of many parameter sets along the path of section 3.2."""
    arm, path, rng = pk.arms.wan_7r(), wan_2018.experiment(), np.random.default_rng(0)
    start = start_postures(path, 40)[0]
    method = pk.methods.WeightedGradientProjection(
        criteria=[
            pk.methods.Criterion(
                objective=pk.velocity_limit_nearness, gain=10.0 ** rng.uniform(-4, -1, SETS), reference=7.0
            )
        ],
        feedback=rng.uniform(20.0, 150.0, SETS),
        buffer=rng.uniform(0.05, 0.45, SETS),
        repulsion=rng.uniform(0.1, 6.0, SETS),
        band=rng.uniform(0.05, 0.45, SETS),
        variant="paper",
    )
    resolve = partial(pk.resolve, arm, path, method, start=start, unreachable="track")
    elapsed, damped = _seconds({"": resolve}, rounds)[""], float((resolve().traces.status != "done").mean())
    middle = float(np.median(elapsed))
    return Row(
        table="parameter sets at once",
        row=f"{SETS} sets, {len(path.times)} samples",
        column="WGPM, as printed",
        unit="s",
        ours=middle,
        reference=GOAL,
        source="goal",
        note=f"{'LOSS: ' if middle > GOAL else ''}goal; median of {rounds}, from {min(elapsed):.3f} to "
        f"{max(elapsed):.3f} s; {damped:.0%} of steps damped or cut short",
    )


def _seconds(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Return the seconds of every call in several rounds, alternating, after a round that is not counted."""
    elapsed: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(rounds + 1):
        tell(f"times of {len(calls)} calls, round {turn} of {rounds}")
        for name, call in calls.items():
            clock = time.perf_counter()
            call()
            elapsed[name].append(time.perf_counter() - clock)
    return {name: seconds[1:] for name, seconds in elapsed.items()}
