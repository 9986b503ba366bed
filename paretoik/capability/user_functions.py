"""Users' functions of motions for small dense programs.

The few unknowns of a program determine the samples of a motion. A term is a function that is minimised or bounded. It
is traced once as a function of positions and rates, at one sample if it depends on one sample at a time. Kinks get
epigraph variables. The program says how positions and rates depend on the unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.kinks import Reformulation, copy_entries, reformulate_choices, reformulate_kinks
from paretoik.autodiff.opcodes import Op
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.nlp.dense.traced_rows import Part, TracedRows, trace_rows
from paretoik.task.limits import Constraint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Form, Objective
from paretoik.task.traced_motion import (
    TracedMotion,
    trace_motion,
    trace_motion_function,
    trace_sample,
    trace_sample_function,
)

ORDERS = ("q", "dq", "ddq", "jerk")  # fields of Motion by which functions are traced


@dataclass(frozen=True, kw_only=True, eq=False)
class Term:
    """``factor`` times a user's function, minimised, or bounded if ``upper`` is finite."""

    label: str
    function: Callable[[Any], Any]
    form: Form
    factor: float
    upper: float = np.inf

    @property
    def is_objective(self) -> bool:
        """Whether the term is minimised."""
        return not np.isfinite(self.upper)


def objective_term(objective: Objective, unit: float) -> Term:
    """Return the term of a minimised objective, divided by a unit."""
    label, factor = f"objective {objective.name}", objective.sign / unit
    return Term(label=label, function=objective.function, form=objective.form, factor=factor)


def constraint_terms(constraint: Constraint) -> list[Term]:
    """Return the finite sides of a constraint, divided by its scale."""
    label, size = f"constraint {constraint.name}", constraint.scale
    return [
        Term(label=label, function=constraint.function, form=constraint.form, factor=sign / size, upper=bound / size)
        for sign, bound in ((1.0, constraint.upper), (-1.0, -constraint.lower))
        if np.isfinite(bound)
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothTerm:
    """A term of a program on its own tape.

    local: whether the term is traced at one sample; else for the whole motion, with one value, or one per sample if it
        is a peak
    inputs: number of the tape's first inputs: positions and rates, then intervals of motions with their own times (the
        duration for one sample)
    parameters: next inputs of the tape, numbers (samples, count) that differ from sample to sample
    units: units of the epigraph variables, the last inputs of the tape
    evaluator: evaluator of values, then of the kinks that have epigraph variables
    orders: number of derivatives of positions that are read
    reads_duration: whether the value at one sample depends on the duration
    """

    term: Term
    local: bool
    motion: TracedMotion
    inputs: int
    parameters: Float[np.ndarray, "samples parameters"]
    reformulation: Reformulation
    evaluator: Evaluator
    units: Float[np.ndarray, " variables"]
    orders: int
    reads_duration: bool

    @property
    def is_sum(self) -> bool:
        """Whether the term is a sum of values times intervals."""
        return self.local and self.term.form == "integral"

    def rows(
        self, inputs: Sequence[Any], parameters: Sequence[Any], variables: Sequence[Any]
    ) -> tuple[list[Any], list[Any]]:
        """Return the values, and the slacks (≥ 0) of epigraph variables, as expressions on another tape."""
        tape, smooth = self.motion.trace.tape, self.reformulation
        scaled = [variable * float(unit) for variable, unit in zip(variables, self.units, strict=True)]
        stand_ins = [*inputs, *parameters, *scaled]
        target = next(value.tape for value in stand_ins if isinstance(value, Expression))
        originals = [*tape.inputs[: self.inputs + self.parameters.shape[1]], *smooth.epigraph_variables]
        places = {place: as_entry(target, value) for place, value in zip(originals, stand_ins, strict=True)}
        copies = copy_entries(tape, [*smooth.functions, *smooth.constraints], target, places)
        entries = [Expression(target, entry) for entry in copies]
        count, ranges = len(smooth.functions), np.repeat(self.units, 2).tolist()
        return entries[:count], [tie / size for tie, size in zip(entries[count:], ranges, strict=True)]

    def evaluate(self, motions: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Return values (points, lanes, values) and epigraph variables (points, lanes, variables) in their units."""
        columns = _columns(motions, self.inputs, self.parameters, self.local)
        table = self.evaluator(_pad(columns, self.motion))
        lanes = table.T.reshape(len(motions), -1, len(table))
        count = len(table) - len(self.units)
        return lanes[..., :count], lanes[..., count:] / self.units


def smooth_term(term: Term, task: MotionTask, near: Motion, *, own_times: bool) -> SmoothTerm:
    """Return a term for motions (points, time, dof) that are similar to ``near``.

    own_times: whether motions have their own times and follow no task

    Kinks are searched for at 64 points around ``near``. Raises InvalidInput, naming the function, if it has no
    derivative.
    """
    value = None
    if own_times and term.form in ("integral", "peak"):  # at one sample, if possible
        motion = trace_sample(task, own_times=True)
        value = trace_sample_function(motion, term.label, term.function)
    values = [] if value is None else [value]
    if value is None:
        motion = trace_motion(task, own_times=own_times)
        values = trace_motion_function(motion, term.label, term.function, term.form)
        if term.form == "integral":
            values = [motion.integral(TracedArray(motion.trace, np.array(values, dtype=object))).entries]
    tape, local = motion.trace.tape, motion.trace.samples is not None
    outputs = [as_entry(tape, term.factor * value) for value in values]
    parameters = np.array(list(motion.trace.parameters.values())).reshape(-1, len(task.times) if local else 1).T
    inputs = len(tape.inputs) - parameters.shape[1]
    columns = _columns(near, inputs, parameters, local)
    rng, rates = np.random.default_rng(0), len(ORDERS) * motion.q.entries.size
    size, columns = np.sqrt(np.mean(columns**2, axis=1, keepdims=True)), rng.choice(columns, 64, axis=1)
    probed = columns + size * rng.normal(size=columns.shape)
    probed[rates:] = columns[rates:]  # intervals and parameters are not perturbed
    labels = [term.label] * len(outputs)
    outputs = reformulate_choices(tape, outputs, labels, probed)
    smooth = reformulate_kinks(tape, outputs, [1] * len(outputs), probed)
    kinks = np.nanmedian(np.abs(compile_evaluator(tape, smooth.nodes)(_pad(columns, motion))), axis=1)
    read = dependencies(tape, [*smooth.functions, *smooth.constraints])
    numbers = [tape.entries[i][1] for i in read if tape.entries[i][0] is Op.INPUT]
    orders = [number // motion.q.entries.size for number in numbers if number < rates]
    return SmoothTerm(
        term=term,
        local=local,
        motion=motion,
        inputs=inputs,
        parameters=parameters,
        reformulation=smooth,
        evaluator=compile_evaluator(tape, [*outputs, *smooth.nodes]),
        units=np.where(kinks > 0, kinks, 1.0),
        orders=max(orders, default=0),
        reads_duration=local and rates in numbers,
    )


def _columns(motions: Motion, inputs: int, parameters: np.ndarray, local: bool) -> Float[np.ndarray, "inputs lanes"]:
    """Return inputs and parameters of motions (points, time, dof), sample by sample if ``local``."""
    points, samples = motions.q.shape[:2]
    orders = np.stack([getattr(motions, name) for name in ORDERS], axis=2 if local else 1)
    if local:
        durations = np.repeat(motions.duration, samples)[:, None]
        return np.hstack([orders.reshape(points * samples, -1), durations, np.tile(parameters, (points, 1))]).T
    return np.concatenate([orders.reshape(points, -1), np.diff(motions.time)], axis=1).T[:inputs]


def _pad(columns: np.ndarray, motion: TracedMotion) -> np.ndarray:
    """Return inputs and parameters with zeros for the other inputs of the tape."""
    return np.pad(columns, ((0, len(motion.trace.tape.inputs) - len(columns)), (0, 0)))


# Rows and unknowns that users' functions of motions add to a small dense program. A minimised term is the sum of its
# values' epigraph variables, one per sample of an integral, else one; a bounded term has its bound instead.


Inputs = Callable[[list[Any], list[Any]], tuple[list[Any], Any]]
"""Function of unknowns and parameters: the inputs of a term, and the interval of its values."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lanes:
    """Samples of a motion, or a whole one. A term's ``inputs`` depend on the unknowns ``where`` and ``parameters``."""

    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]
    inputs: Inputs


LanesOf = Callable[[SmoothTerm, list[int]], list[Lanes]]
"""Function of a term and its samples: lanes for all of these, in order; one for a whole motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TermRows:
    """Rows and unknowns of terms.

    samples: number of samples of motions
    first: number of unknowns of the program, which come before those of the terms
    intervals: indices of unknowns for intervals; none if times are fixed
    pace: unit of the intervals [s]

    The mean interval is an unknown too if a term at one sample reads the duration.
    """

    terms: tuple[SmoothTerm, ...]
    samples: int
    first: int
    intervals: Int[np.ndarray, " intervals"]
    pace: float = 1.0

    @property
    def reads_duration(self) -> bool:
        """Whether the first unknown is the mean interval."""
        return any(term.reads_duration for term in self.terms)

    def lanes(self, term: SmoothTerm) -> list[int]:
        """Return the samples of a term's lanes; a sum has none for the first sample, which has no interval."""
        return list(range(int(term.is_sum), self.samples if term.local else 1))

    @cached_property
    def indices(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Indices of every term's epigraph variables: of values (count,), and of kinks (lanes, variables)."""
        indices, end = list[tuple[np.ndarray, np.ndarray]](), self.first + self.reads_duration
        for term in self.terms:
            lanes = len(self.lanes(term))
            count, variables = lanes if term.is_sum else int(term.term.is_objective), len(term.units)
            numbers = end + np.arange(count + lanes * variables)
            indices.append((numbers[:count], numbers[count:].reshape(lanes, variables)))
            end += len(numbers)
        return indices

    @property
    def unknowns(self) -> int:
        """Number of all unknowns, with those of the program."""
        return self.first + self.reads_duration + sum(a.size + b.size for a, b in self.indices)

    @property
    def costs(self) -> Float[np.ndarray, "objectives unknowns"]:
        """Gradients of the minimised objectives, in their own units."""
        objectives = [
            (one.term.factor, epigraphs)
            for one, (epigraphs, _) in zip(self.terms, self.indices, strict=True)
            if one.term.is_objective
        ]
        costs = np.zeros((len(objectives), self.unknowns))
        for row, (factor, epigraphs) in zip(costs, objectives, strict=True):
            row[epigraphs] = 1.0 / abs(factor)
        return costs

    def values(self, motions: Motion) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of motions (points, time, dof) beyond those of the program."""
        columns = [motions.duration[:, None] / (self.pace * len(self.intervals))] if self.reads_duration else []
        for term, (epigraphs, _) in zip(self.terms, self.indices, strict=True):
            values, variables = term.evaluate(motions)
            if term.is_sum:
                intervals = np.diff(motions.time)
                columns.append(values[:, 1:, 0] * intervals)
                variables = variables[:, 1:] * intervals[..., None] / self.pace
            elif len(epigraphs):
                columns.append(values.max(axis=(1, 2))[:, None])
            columns.append(variables.reshape(len(motions), -1))
        return np.concatenate(columns, axis=1) if columns else np.zeros((len(motions), 0))

    def parts(self, lanes_of: LanesOf) -> tuple[Part, ...]:
        """Return the rows of all terms."""
        parts, none = list[Part](), np.zeros((1, 0))
        if self.reads_duration:
            count, where = len(self.intervals), np.append(self.intervals, self.first)[None]
            mean = trace_rows(count + 1, 0, lambda z, _: ([z[-1] - sum(z[:-1], start=0.0) * (1 / count)], []))
            parts.append(Part(program=mean, where=where, parameters=none))
        for term, (epigraphs, variables) in zip(self.terms, self.indices, strict=True):
            samples, done = self.lanes(term), 0
            for lanes in lanes_of(term, samples):
                count = len(lanes.where)
                rows = slice(done, done + count)
                epigraph = epigraphs[rows, None] if term.is_sum else np.tile(epigraphs, (count, 1))
                numbers = term.parameters[samples[rows]] if term.local else term.parameters
                interval = np.full((count, int(term.reads_duration)), self.first)
                unknowns = np.concatenate([variables[rows], interval, epigraph], axis=1)
                parts.append(self._part(term, lanes, unknowns, numbers))
                done += count
            if term.is_sum and not term.term.is_objective:
                total = _bounded_sum(len(epigraphs), term.term.upper)
                parts.append(Part(program=total, where=epigraphs[None], parameters=none))
        return tuple(parts)

    def _part(self, term: SmoothTerm, lanes: Lanes, unknowns: np.ndarray, numbers: np.ndarray) -> Part:
        """Return the rows of a term in lanes.

        unknowns: indices (lanes, count) of epigraph variables of kinks, mean interval, epigraph variable of the value
        """
        size, width, end = lanes.where.shape[1], lanes.parameters.shape[1], lanes.where.shape[1] + len(term.units)
        has_epigraph = unknowns.shape[1] > len(term.units) + term.reads_duration

        def rows(z: list[Any], p: list[Any]) -> tuple[list[Any], list[Any]]:
            inputs, interval = lanes.inputs(z[:size], p[:width])
            if term.local:
                inputs = [*inputs, z[end] * (self.pace * len(self.intervals)) if term.reads_duration else 1.0]
            share = interval * (1 / self.pace) if term.is_sum else 1.0
            values, ties = term.rows(inputs, p[width:], [variable / share for variable in z[size:end]])
            upper, weight = z[-1] if has_epigraph else term.term.upper, interval if term.is_sum else 1.0
            return [], [*(upper - weight * value for value in values), *(share * tie for tie in ties)]

        where = np.concatenate([lanes.where, unknowns], axis=1)
        parameters = np.concatenate([lanes.parameters, numbers], axis=1)
        return Part(program=trace_rows(where.shape[1], parameters.shape[1], rows), where=where, parameters=parameters)


def _bounded_sum(count: int, upper: float) -> TracedRows:
    return trace_rows(count, 0, lambda z, _: ([], [upper - sum(z, start=0.0)]))
