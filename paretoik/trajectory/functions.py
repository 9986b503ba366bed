"""What is minimised and what is bounded, written down: the objectives and limits of a task as expressions.

Functions that look at every sample by itself become sums over samples, or rows that are bounded at every sample; the
others are functions of the whole motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.rewriting import smooth_pieces
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.task.limits import Constraint
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.traced_motion import (
    TracedMotion,
    trace_motion,
    trace_motion_function,
    trace_sample,
    trace_sample_function,
)
from paretoik.trajectory.whole_functions import Whole, whole_function


@dataclass(frozen=True, kw_only=True)
class Total:
    """A number of a whole motion: ``index`` counts those of its kind; it may not be more than ``upper``."""

    name: str
    kind: Literal["sum", "peak", "whole"]
    index: int
    upper: float = np.inf


@dataclass(kw_only=True, eq=False)
class Functions:
    """The functions of a task: totals, objectives first, and entries on the tape of one sample.

    ``sums`` are integrated; ``rows``, by name, lie between ``bounds`` (time, 2); a peak is the largest at any sample of
    its pieces: ``tops`` are the epigraph variables σ, and ``under`` the entries σ − piece that have to be at least 0.
    """

    motion: TracedMotion
    totals: list[Total] = field(default_factory=list)
    sums: list[int] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    bounds: list[np.ndarray] = field(default_factory=list)
    tops: list[int] = field(default_factory=list)
    under: list[int] = field(default_factory=list)
    over: list[int] = field(default_factory=list)
    wholes: list[Whole] = field(default_factory=list)

    @property
    def distances(self) -> list[int]:
        """What the distances to obstacles are made of: pieces that meet without a kink."""
        known = self.motion.task.obstacles
        return dependencies(
            self.motion.trace.tape, [as_entry(self.motion.trace.tape, self.motion.clearance.entries)] if known else []
        )


def functions(task: MotionTask, shares: np.ndarray) -> Functions:
    """Return the functions of a task, every objective times its share.

    Raises InvalidInput, naming the objective or limit, where its derivative cannot be had.
    """
    found = Functions(motion=trace_sample(task))
    for given, share in zip(task.objectives, shares, strict=True):
        _add_total(found, f"objective {given.name}", given, given.sign * float(share), np.inf)
    _add_limits(found)
    for constraint in task.constraints:
        what = f"constraint {constraint.name}"
        value = trace_sample_function(found.motion, what, constraint.function) if constraint.form == "peak" else None
        if value is not None:
            bounds = np.array([constraint.lower, constraint.upper]) / constraint.scale
            _add_row(found, constraint.name, value * (1.0 / constraint.scale), bounds)
            continue
        for sign, bound in ((1.0, constraint.upper), (-1.0, -constraint.lower)):
            if np.isfinite(bound):
                _add_total(found, what, constraint, sign / constraint.scale, bound / constraint.scale)
    return found


def _add_total(found: Functions, what: str, given: Objective | Constraint, factor: float, upper: float) -> None:
    motion, form = found.motion, given.form
    value = trace_sample_function(motion, what, given.function) if form in ("integral", "peak") else None
    if value is None:
        found.totals.append(Total(name=given.name, kind="whole", index=len(found.wholes), upper=upper))
        found.wholes.append(_whole(motion.task, what, given, factor))
        return
    tape = motion.trace.tape
    top, share = as_entry(tape, np.sign(factor) * value), tape.input()  # an input: other shares, the same program
    motion.trace.parameters[share.index] = np.full(len(motion.time), abs(factor))
    if form == "integral":
        found.totals.append(Total(name=given.name, kind="sum", index=len(found.sums), upper=upper))
        found.sums.append((share * Expression(tape, top)).index)
        return
    found.totals.append(Total(name=given.name, kind="peak", index=len(found.tops), upper=upper))
    sigma = tape.input()
    for piece in smooth_pieces(tape, top):
        found.under.append((sigma - share * Expression(tape, piece)).index)
        found.over.append(len(found.tops))
    found.tops.append(sigma.index)


def _whole(task: MotionTask, what: str, given: Objective | Constraint, factor: float) -> Whole:
    motion = trace_motion(task)
    values = trace_motion_function(motion, what, given.function, given.form)
    total: Any = 0.0
    if given.form == "integral":
        for weight, value in zip(task.weights, values, strict=True):
            total = total + factor * float(weight) * value
    else:
        total = factor * values[0]
        for value in values[1:]:  # a peak
            total = np.maximum(total, factor * value)
    return whole_function(motion.trace.tape, given.name, total)


def _add_limits(found: Functions) -> None:
    """Add the limits that are not on positions and rates themselves."""
    motion, task = found.motion, found.motion.task
    series: dict[str, Callable[[], Any]] = {"torque": lambda: motion.torque, "power": lambda: motion.power}
    for kind, limits in task.bounds.items():
        for j, joint in enumerate(task.arm.joint_names if kind in series else ()):
            if np.isfinite(limits[:, j]).any():
                _add_row(found, f"{kind} of {joint}", series[kind]().entries[j], limits[:, j])
    if task.obstacles:
        _add_row(found, "clearance", motion.clearance.entries, np.array([task.min_clearance, np.inf]))


def _add_row(found: Functions, name: str, value: Any, bounds: np.ndarray) -> None:
    """Add a function of a sample between bounds (time or 1, 2), by its smooth pieces where it has kinks."""
    tape, samples = found.motion.trace.tape, len(found.motion.task.times)
    top, both = as_entry(tape, value), np.broadcast_to(bounds, (samples, 2))
    below, above = smooth_pieces(tape, top, -1), smooth_pieces(tape, top, 1)
    sides = [(top, both)]
    if len(below) > 1 or len(above) > 1:
        free = np.full(samples, np.inf)
        sides = [(piece, np.stack([both[:, 0], free], axis=1)) for piece in below]
        sides += [(piece, np.stack([-free, both[:, 1]], axis=1)) for piece in above]
    for piece, limits in sides:
        if np.isfinite(limits).any():
            found.names.append(name)
            found.rows.append(piece)
            found.bounds.append(limits)
