"""Objectives and limits of a task as expressions on a tape.

Functions of one sample become sums over samples, or rows with bounds at every sample. The other functions become
functions of the whole motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.autodiff.differentiation import dependencies, gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.kinks import norm_terms, smooth_pieces, summands
from paretoik.autodiff.opcodes import Op
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.nlp.program import Cone, structural_product
from paretoik.robot.kinematics import joint_scales
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

# Functions of the whole motion, which relate its samples to one another
#
#     F = Σ max(group) over groups of parts,  or  F = factor · ‖parts‖
#
# The parts are smooth numbers. Derivatives are by positions and rates of all samples; second derivatives are taken
# along directions.


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeFunction:
    """A function of all u (orders · time · dof).

    It is Σ max(group) over ``groups`` of parts, or ``factor`` · ‖parts‖ if there are no groups.
    """

    name: str
    groups: Int[np.ndarray, " groups"]  # index of each group's first part
    factor: float
    parts: int
    value: Evaluator
    jacobian_evaluator: Evaluator  # evaluator of the derivatives of parts (``rows``) by inputs (``columns``)
    rows: Int[np.ndarray, " entries"]
    columns: Int[np.ndarray, " entries"]
    # evaluator of the entries ``hessian_columns`` of H · direction, with H the Hessian of Σ multiplier · part; it takes
    # u, a direction in u, and one multiplier per part
    hessian_evaluator: Evaluator
    hessian_columns: Int[np.ndarray, " second"]
    inputs: int

    def combine(self, values: Float[np.ndarray, " parts"]) -> float:
        """Return the function's value from the values of its parts."""
        if not len(self.groups):
            return self.factor * float(np.linalg.norm(values))
        return float(np.maximum.reduceat(values, self.groups).sum())

    @property
    def slices(self) -> list[slice]:
        """The parts of every group."""
        return [slice(a, b) for a, b in pairwise([*self.groups.tolist(), self.parts])]

    @property
    def epigraph_columns(self) -> int:
        """Number of epigraph variables: one per group of several parts, or one for a length."""
        return sum(part.stop - part.start > 1 for part in self.slices) if len(self.groups) else 1

    def jacobian(self, u: Float[np.ndarray, " inputs"]) -> sparse.csr_array:
        """Return the derivatives (parts, inputs) of the parts."""
        entries = self.jacobian_evaluator(u[:, None])[:, 0]
        return sparse.csr_array(sparse.coo_array((entries, (self.rows, self.columns)), shape=(self.parts, self.inputs)))

    def linearise(
        self, u: Float[np.ndarray, " inputs"], parts: np.ndarray, by_columns: sparse.csr_array, column: int
    ) -> tuple[np.ndarray, list[np.ndarray], list[sparse.csr_array], list[Cone]]:
        """Return (gradient by the columns, ties, Jacobian rows of ties, cones).

        ``by_columns`` has the derivatives of u (inputs, columns). Epigraph variables begin at ``column``.
        """
        gradient, ties, tie_rows = np.zeros(by_columns.shape[1]), list[np.ndarray](), list[sparse.csr_array]()
        rows = structural_product(self.jacobian(u), by_columns)
        if not len(self.groups):
            gradient[column] = 1.0
            cone = Cone(column=column, values=self.factor * parts, rows=sparse.csr_array(self.factor * rows))
            return gradient, ties, tie_rows, [cone]
        for group in self.slices:
            if group.stop - group.start == 1:
                gradient += rows[[group.start]].toarray()[0]
                continue
            gradient[column] = 1.0
            ties.append(parts[group].max() - parts[group])
            part = rows[group]  # the new last column minus the rows
            entries = np.insert(-part.data, part.indptr[1:], 1.0)
            indices = np.insert(part.indices, part.indptr[1:], column)
            indptr = part.indptr + np.arange(len(part.indptr))
            tie_rows.append(sparse.csr_array((entries, indices, indptr), shape=part.shape))
            column += 1
        return gradient, ties, tie_rows, []

    def hessian_along(
        self, u: Float[np.ndarray, " inputs"], directions: sparse.csr_array, multipliers: Float[np.ndarray, " parts"]
    ) -> Float[np.ndarray, "columns columns"]:
        """Return Dᵀ H D for directions D (inputs, columns).

        H is the Hessian of Σ multipliers · parts.
        """
        if not len(self.hessian_columns):
            return np.zeros((directions.shape[1], directions.shape[1]))
        dense = directions.toarray()
        columns = dense.shape[1]
        fixed = np.concatenate([u[:, None], multipliers[:, None]])
        inputs = np.concatenate([np.repeat(fixed[: len(u)], columns, 1), dense, np.repeat(fixed[len(u) :], columns, 1)])
        along = self.hessian_evaluator(inputs)
        product: np.ndarray = dense[self.hessian_columns].T @ along
        return (product + product.T) / 2


def whole_function(tape: Tape, name: str, value: object) -> WholeFunction:
    """Return the ``WholeFunction`` of a value traced with all u as inputs."""
    entry, count = as_entry(tape, value), len(tape.inputs)
    norm, zero = norm_terms(tape, entry), tape.constant(0.0)
    # one group for all smooth addends, and one for the pieces of each addend with kinks
    smooth, groups = zero, list[list[int]]()
    for term in summands(tape, entry) if norm is None else ():
        pieces = smooth_pieces(tape, term)
        if len(pieces) > 1:
            groups.append(pieces)
        else:
            smooth = tape.apply(Op.ADD, smooth, term)
    if norm is None:
        groups.insert(0, [smooth])
    factor, parts = (1.0, [part for group in groups for part in group]) if norm is None else norm
    entries = []
    for k, part in enumerate(parts):
        inputs = [i for i in dependencies(tape, [part]) if tape.entries[i][0] is Op.INPUT]
        slopes = gradient(tape, part, inputs)
        entries += [(k, tape.entries[i][1], slope) for i, slope in zip(inputs, slopes, strict=True) if slope != zero]
    directions = [tape.input().index for _ in range(count)]
    total = zero
    for part in parts:
        total = tape.apply(Op.ADD, total, tape.apply(Op.MULTIPLY, tape.input().index, part))
    columns = sorted({j for _, j, _ in entries})
    slopes = gradient(tape, total, [tape.inputs[j] for j in columns])
    along = tangents(tape, slopes, {tape.inputs[j]: directions[j] for j in columns})
    second = [(j, entry) for j, entry in zip(columns, along, strict=True) if entry != zero]
    places = np.array([(k, j) for k, j, _ in entries], dtype=np.int64).reshape(-1, 2)
    return WholeFunction(
        name=name,
        groups=np.cumsum([0, *map(len, groups)], dtype=np.int64)[:-1],
        factor=factor,
        parts=len(parts),
        value=compile_evaluator(tape, parts),
        jacobian_evaluator=compile_evaluator(tape, [slope for *_, slope in entries]),
        rows=places[:, 0],
        columns=places[:, 1],
        hessian_evaluator=compile_evaluator(tape, [entry for _, entry in second]),
        hessian_columns=np.array([j for j, _ in second], dtype=np.int64),
        inputs=count,
    )


# Objectives and limits of a task as expressions.


@dataclass(frozen=True, kw_only=True)
class Total:
    """A number of the whole motion, at most ``upper``; ``index`` is its index within its kind."""

    name: str
    kind: Literal["sum", "peak", "whole"]
    index: int
    upper: float = np.inf


@dataclass(kw_only=True, eq=False)
class Functions:
    """The functions of a task, as entries on a sample's tape.

    Integrals with kinks are taken on the spline. Many motions have the same travel, for example, but errors of
    Simpson's rule on the curve would make it differ.
    """

    task: MotionTask
    motion: TracedMotion  # instant of the motion's curve on the tape
    spline: TracedMotion  # instant of the motion's spline on the tape, for integrals with kinks
    totals: list[Total] = field(default_factory=list)
    sums: list[int] = field(default_factory=list)  # entries that are integrated
    names: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)  # entries that are bounded at every instant, one per name
    # (instants, 3) of each row: lower bound, upper bound, and range that divides violations
    bounds: list[np.ndarray] = field(default_factory=list)
    # epigraph variable σ of each peak, the largest piece at any sample
    epigraph_variables: list[int] = field(default_factory=list)
    epigraph_rows: list[int] = field(default_factory=list)  # entries σ − piece ≥ 0
    epigraph_peaks: list[int] = field(default_factory=list)  # peak of each of these entries
    whole_functions: list[WholeFunction] = field(default_factory=list)

    @property
    def distances(self) -> list[int]:
        """Entries that clearance depends on; pieces of distances meet without a kink."""
        tape, obstacles = self.motion.trace.tape, self.task.obstacles
        return dependencies(tape, [as_entry(tape, self.motion.clearance.entries)] if obstacles else [])


def function_names(totals: Sequence[Total], rows: Sequence[str], peaks: Iterable[int]) -> list[str]:
    """Return the names of an instant's functions: sums, rows, epigraph rows."""
    by_peak = [total.name for total in totals if total.kind == "peak"]
    return [*(total.name for total in totals if total.kind == "sum"), *rows, *(by_peak[i] for i in peaks)]


def trace_functions(task: MotionTask, shares: np.ndarray) -> Functions:
    """Return the functions of a task, each objective multiplied by its share.

    Raises InvalidInput, naming the objective or limit, if it has no derivative.
    """
    scales = joint_scales(task.arm)
    motion = trace_sample(task, scales=scales)
    functions = Functions(task=task, motion=motion, spline=trace_sample_again(motion, scales))
    for term, share in zip(task.objectives, shares, strict=True):
        _add_total(functions, f"objective {term.name}", term, term.sign * float(share), np.inf)
    # add the limits, except those on positions, and on rates at samples, which bound variables
    inner = ["velocity"] if task.differences == "spline" and "velocity" in task.bounds else []
    for kind in (*inner, *(load for load in ("torque", "power") if load in task.bounds)):
        limits = task.bounds_at(kind, task.instants)
        if kind == "velocity":  # limits on Bernstein coefficients between samples; see ``Motion.velocity_bounds``
            bounds, limits = limits, np.tile([-np.inf, np.inf], (len(task.instants), task.arm.dof, 1))
            limits[:-1:2] = np.broadcast_to(bounds, limits.shape)[1::2]
            values = motion.velocity_bounds.entries
        else:
            values = getattr(motion, LIMITED[kind]).entries
        ranges = task.limit_ranges(kind, limits)
        for j, joint in enumerate(task.arm.joint_names):
            if np.isfinite(limits[:, j]).any():
                _add_row(functions, f"{kind} of {joint}", values[j], limits[:, j], ranges[:, j])
    if task.obstacles:
        clearance = np.array([task.min_clearance, np.inf])
        _add_row(functions, "clearance", motion.clearance.entries, clearance, np.array(task.clearance_range))
    for constraint in task.constraints:
        label = f"constraint {constraint.name}"
        value = trace_sample_function(motion, label, constraint.function) if constraint.form == "peak" else None
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
        # a function of the whole motion
        whole_motion = trace_motion(task, scales=joint_scales(task.arm))
        values = trace_motion_function(whole_motion, label, term.function, term.form)
        total: Any = 0.0
        if term.form == "integral":
            for weight, number in zip(task.weights, values, strict=True):
                total = total + factor * float(weight) * number
        else:
            total = factor * values[0]
            for number in values[1:]:  # the peak is the largest number
                total = np.maximum(total, factor * number)
        functions.whole_functions.append(whole_function(whole_motion.trace.tape, term.name, total))
        return
    tape = motion.trace.tape
    entry, share = as_entry(tape, np.sign(factor) * value), tape.input()  # one evaluator for all shares
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


def _add_row(functions: Functions, name: str, value: Any, bounds: np.ndarray, ranges: np.ndarray) -> None:
    """Add an instant's function, or its smooth pieces, between bounds (instants, 2)."""
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
            functions.bounds.append(np.column_stack([limits, np.broadcast_to(ranges, instants)]))
