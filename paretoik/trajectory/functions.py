"""Objectives and limits of a task as expressions on a tape.

Functions of one sample at a time become sums over samples, or rows that are bounded at every sample; the others are
functions of the whole motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.rewriting import smooth_pieces
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.robot.scales import joint_scales
from paretoik.task.limits import LIMITED, Constraint
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.traced_motion import (
    TracedMotion,
    has_kinks,
    trace_motion,
    trace_motion_function,
    trace_sample,
    trace_sample_again,
    trace_sample_function,
)
from paretoik.trajectory.whole_functions import WholeFunction, whole_function

LOADS = ("torque", "power")


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

    ``sums`` are integrated; ``rows``, by name, lie between ``bounds`` (time, 2), violations being shares of ``ranges``
    (time,). A peak is the largest at any sample of
    its pieces: its epigraph variable σ is in ``epigraph_variables``, the entries σ − piece ≥ 0 in ``epigraph_rows``;
    ``epigraph_peaks`` says for each of these which peak it belongs to.

    ``motion`` is an instant of the motion's curve. Integrals with kinks are those of its ``spline``: a travel, for one,
    is the same along many motions, and what Simpson's rule leaves on the curve would tell these apart.
    """

    task: MotionTask
    motion: TracedMotion
    spline: TracedMotion
    totals: list[Total] = field(default_factory=list)
    sums: list[int] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    bounds: list[np.ndarray] = field(default_factory=list)
    ranges: list[np.ndarray] = field(default_factory=list)
    epigraph_variables: list[int] = field(default_factory=list)
    epigraph_rows: list[int] = field(default_factory=list)
    epigraph_peaks: list[int] = field(default_factory=list)
    whole_functions: list[WholeFunction] = field(default_factory=list)

    @property
    def distances(self) -> list[int]:
        """Entries of the distances to obstacles: pieces that meet without a kink."""
        tape, obstacles = self.motion.trace.tape, self.task.obstacles
        return dependencies(tape, [as_entry(tape, self.motion.clearance.entries)] if obstacles else [])


def trace_functions(task: MotionTask, shares: np.ndarray) -> Functions:
    """Return the functions of a task, each objective multiplied by its share.

    Raises InvalidInput, naming the objective or limit, where its derivative cannot be had.
    """
    scales = joint_scales(task.arm)
    motion = trace_sample(task, scales=scales)
    functions = Functions(task=task, motion=motion, spline=trace_sample_again(motion, scales))
    for term, share in zip(task.objectives, shares, strict=True):
        _add_total(functions, f"objective {term.name}", term, term.sign * float(share), np.inf)
    _add_limits(functions)
    for constraint in task.constraints:
        label = f"constraint {constraint.name}"
        value = (
            trace_sample_function(functions.motion, label, constraint.function) if constraint.form == "peak" else None
        )
        if value is not None:
            bounds = np.array([constraint.lower, constraint.upper])
            _add_row(functions, constraint.name, value, bounds, np.array(constraint.scale))
            continue
        for sign, bound in ((1.0, constraint.upper), (-1.0, -constraint.lower)):
            if np.isfinite(bound):
                _add_total(functions, label, constraint, sign / constraint.scale, bound / constraint.scale)
    return functions


def _add_total(functions: Functions, label: str, term: Objective | Constraint, factor: float, upper: float) -> None:
    task, motion, form = functions.task, functions.motion, term.form
    if form == "integral" and task.differences == "spline":
        kinked = has_kinks(term, task.arm, task.tasks, task.obstacles, task.link_radius)
        motion = functions.spline if kinked else motion
    value = trace_sample_function(motion, label, term.function) if form in ("integral", "peak") else None
    if value is None:
        functions.totals.append(Total(name=term.name, kind="whole", index=len(functions.whole_functions), upper=upper))
        functions.whole_functions.append(_whole(task, label, term, factor))
        return
    tape = motion.trace.tape
    entry, share = as_entry(tape, np.sign(factor) * value), tape.input()  # an input: other shares, the same evaluators
    motion.trace.parameters[share.index] = np.full(len(motion.time), abs(factor))
    if form == "integral":
        functions.totals.append(Total(name=term.name, kind="sum", index=len(functions.sums), upper=upper))
        functions.sums.append((share * Expression(tape, entry)).index)
        return
    functions.totals.append(Total(name=term.name, kind="peak", index=len(functions.epigraph_variables), upper=upper))
    sigma = tape.input()
    for piece in smooth_pieces(tape, entry):
        functions.epigraph_rows.append((sigma - share * Expression(tape, piece)).index)
        functions.epigraph_peaks.append(len(functions.epigraph_variables))
    functions.epigraph_variables.append(sigma.index)


def _whole(task: MotionTask, label: str, term: Objective | Constraint, factor: float) -> WholeFunction:
    motion = trace_motion(task, scales=joint_scales(task.arm))
    values = trace_motion_function(motion, label, term.function, term.form)
    total: Any = 0.0
    if term.form == "integral":
        for weight, value in zip(task.weights, values, strict=True):
            total = total + factor * float(weight) * value
    else:
        total = factor * values[0]
        for value in values[1:]:  # a peak
            total = np.maximum(total, factor * value)
    return whole_function(motion.trace.tape, term.name, total)


def _add_limits(functions: Functions) -> None:
    """Add the limits that are not on positions and rates themselves."""
    task = functions.task
    if task.differences == "spline" and "velocity" in task.bounds:
        _add_inner_velocities(functions)
    _add_loads(functions)
    if task.obstacles:
        bounds, ranges = np.array([task.min_clearance, np.inf]), np.array(task.clearance_range)
        _add_row(functions, "clearance", functions.motion.clearance.entries, bounds, ranges)


def _add_loads(functions: Functions) -> None:
    motion, task = functions.motion, functions.task
    for kind in LOADS:
        if kind not in task.bounds:
            continue
        limits, values = task.bounds_at(kind, task.instants), getattr(motion, LIMITED[kind]).entries
        ranges = task.limit_ranges(kind, limits)
        for j, joint in enumerate(task.arm.joint_names):
            if np.isfinite(limits[:, j]).any():
                _add_row(functions, f"{kind} of {joint}", values[j], limits[:, j], ranges[:, j])


def _add_inner_velocities(functions: Functions) -> None:
    """Add the limits on the Bernstein coefficients of velocities between samples; see ``Motion.velocity_bounds``."""
    motion, task = functions.motion, functions.task
    bounds = np.tile([-np.inf, np.inf], (len(task.instants), task.arm.dof, 1))
    bounds[:-1:2] = np.broadcast_to(task.bounds_at("velocity", task.instants), bounds.shape)[1::2]
    values, ranges = motion.velocity_bounds.entries, task.limit_ranges("velocity", bounds)
    for j, joint in enumerate(task.arm.joint_names):
        if np.isfinite(bounds[:, j]).any():
            _add_row(functions, f"velocity of {joint}", values[j], bounds[:, j], ranges[:, j])


def _add_row(functions: Functions, name: str, value: Any, bounds: np.ndarray, ranges: np.ndarray) -> None:
    """Add a function of an instant between bounds (instants or 1, 2), by its smooth pieces where it has kinks."""
    tape, instants = functions.motion.trace.tape, len(functions.task.instants)
    entry, both = as_entry(tape, value), np.broadcast_to(bounds, (instants, 2))
    below, above = smooth_pieces(tape, entry, -1), smooth_pieces(tape, entry, 1)
    sides = [(entry, both)]
    if len(below) > 1 or len(above) > 1:
        free = np.full(instants, np.inf)
        sides = [(piece, np.stack([both[:, 0], free], axis=1)) for piece in below]
        sides += [(piece, np.stack([-free, both[:, 1]], axis=1)) for piece in above]
    for piece, limits in sides:
        if np.isfinite(limits).any():
            functions.names.append(name)
            functions.rows.append(piece)
            functions.bounds.append(limits)
            functions.ranges.append(np.broadcast_to(ranges, instants))
