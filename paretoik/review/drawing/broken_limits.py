"""Limits of joints that a motion breaks, in words: a method may know none of them, and what it does then shows."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.review.drawing_options import DRAWING
from paretoik.review.joint_units import is_sliding
from paretoik.review.recording.recorded_point import RecordedMotion, joint_curves
from paretoik.review.recording.workcell import Workcell
from paretoik.task.limits import JOINT_UNITS, limit_ranges


def broken_limits(cell: Workcell, motion: RecordedMotion) -> list[str]:
    """Return a line of Markdown for every limit of a joint that a motion breaks, by how much it breaks it at most."""
    lines = list[str]()
    for kind, values in joint_curves(cell, motion).items():
        if kind not in cell.bounds:
            continue
        bounds = _bounds_at(cell, kind, motion)
        for joint, name in enumerate(cell.arm.joint_names):
            unit = JOINT_UNITS[kind][int(is_sliding(cell.arm)[joint])]
            words = _broken(motion.time, values[:, joint], bounds[:, joint], unit)
            lines += [f"- **{name}, {kind}**: {words}"] if words else []
    return lines


def _broken(time: np.ndarray, values: np.ndarray, bounds: Float[np.ndarray, "time 2"], unit: str) -> str:
    """Return how curve values break their bounds, "" where they keep them."""
    low, high = bounds.T
    excess = np.maximum(values - high, low - values)
    over = excess > DRAWING.limit_tolerance * limit_ranges(low, high)
    if not over.any():
        return ""
    worst, first = int(np.argmax(np.where(over, excess, -np.inf))), int(over.argmax())
    limit = high[worst] if values[worst] > high[worst] else low[worst]
    return (
        f"reaches {values[worst]:.3g} {unit} at {time[worst]:.3g} s, limit {limit:.3g} {unit}; broken by up to "
        f"{excess[worst]:.3g} {unit}, first at {time[first]:.3g} s, at {over.sum()} of {len(time)} samples"
    )


def _bounds_at(cell: Workcell, kind: str, motion: RecordedMotion) -> Float[np.ndarray, "time dof 2"]:
    """Return the bounds at the samples of a motion, which may end before its path does."""
    bounds = cell.bounds[kind]
    if len(bounds) == 1:
        return np.broadcast_to(bounds, (len(motion.time), *bounds.shape[1:]))
    rows = np.abs(cell.times[:, None] - motion.time).argmin(axis=0)
    return np.asarray(bounds[rows])
