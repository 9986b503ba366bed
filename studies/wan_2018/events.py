"""The text's events of Figures 6, 7, 10 and 11: singularity, largest error, limits, and jumps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from paretoik.resolution.kernels import clamping_weight
from paretoik.resolution.protocol import ResolvedMotion
from problems.wan_2018 import BUFFER
from studies.reporting import Row
from studies.wan_2018.methods import VARIANTS, Resolved, axis_errors, paper

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
        rows += _later_rows(resolved) if resolved.table == "Table 2" else []
    return rows


def _row(event: Event, name: str, method: str, values: np.ndarray, nearest: int) -> Row:
    printed = paper()[event.figure, event.column, method]
    reason = _depth_of_weight(printed) if event.measure is least_weight else event.reason
    happens = values[np.isfinite(values)]
    low, middle, high = np.quantile(happens, [0.25, 0.5, 0.75]) if len(happens) else (np.nan,) * 3
    return Row(
        table="events of the figures, medians over starts",
        row=f"{event.figure}, {name}",
        column=event.column,
        unit="" if event.measure is least_weight else "s",
        ours=float(middle),
        reference=printed,
        note=f"quartiles {low:.3g} and {high:.3g}, in {len(happens) / len(values):.0%} of motions, in those drawn "
        f"{values[nearest]:.3g}; {reason}",
    )


def _depth_of_weight(weight: float) -> str:
    """Return in words the depth in its buffer at which a joint has a clamping weight."""
    depth = float(brentq(lambda d: clamping_weight(d) - weight, 0.01, 0.99))
    return (
        f"{weight} is that of a joint {depth:.0%} deep in its buffer, {BUFFER * (1 - depth):.0%} of its range from the "
        "limit; no start is printed, and from ours it goes nearer, or not into its buffer"
    )


def _later_rows(resolved: Resolved) -> list[Row]:
    first = first_damped(resolved.motions[resolved.baseline])
    return [
        Row(
            table="events of the figures, medians over starts",
            row=f"Figure 7, {name}",
            column=f"singular later than by {resolved.baseline}",
            unit="share of starts",
            ours=float((np.nan_to_num(first_damped(resolved.motions[name]), nan=np.inf) > first).mean()),
            note="the paper: it is later; a joint in its buffer lowers the clamped Jacobian's singular values from the "
            "first sample on",
        )
        for name in VARIANTS
    ]
