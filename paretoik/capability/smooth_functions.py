"""Users' functions of motions for small dense programs: traced, kinks written with epigraph variables.

Such a program has a few unknowns that the samples of a motion follow from. A term, a function with its sense, is traced
once by positions and their rates, at one sample where it looks at one at a time; what these are of the unknowns the
program says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.kinks import Reformulation, reformulate_choices, reformulate_kinks
from paretoik.autodiff.operations import Op
from paretoik.autodiff.rewriting import copy_entries
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
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

ORDERS = ("q", "dq", "ddq", "jerk")  # of Motion: what functions are traced by


@dataclass(frozen=True, kw_only=True, eq=False)
class Term:
    """``factor`` times a user's function: to be small, or, where ``upper`` is finite, at most that."""

    label: str
    function: Callable[[Any], Any]
    form: Form
    factor: float
    upper: float = np.inf

    @property
    def is_objective(self) -> bool:
        """Whether the term is to be small."""
        return not np.isfinite(self.upper)


def objective_term(objective: Objective, unit: float) -> Term:
    """Return an objective, minimised and counted in a unit."""
    label, factor = f"objective {objective.name}", objective.sign / unit
    return Term(label=label, function=objective.function, form=objective.form, factor=factor)


def constraint_terms(constraint: Constraint) -> list[Term]:
    """Return the sides of a constraint, divided by its scale."""
    label, size = f"constraint {constraint.name}", constraint.scale
    return [
        Term(label=label, function=constraint.function, form=constraint.form, factor=sign / size, upper=bound / size)
        for sign, bound in ((1.0, constraint.upper), (-1.0, -constraint.lower))
        if np.isfinite(bound)
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothTerm:
    """A term on a tape of its own: of one sample (``local``) one value, of a whole motion one or, of peaks, one each.

    The tape's inputs are positions and rates, ``inputs`` of them, with the intervals of motions that have times of
    their own (of one sample: the duration); then ``parameters`` (samples, count), numbers that change from sample to
    sample; then epigraph variables, counted in ``units``. ``evaluator`` gives the values, and the kinks that these
    variables stand for. ``orders`` says how often positions are differentiated, ``reads_duration`` whether the value at
    one sample depends on the duration.
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
        """Whether the term is the sum of its values over samples, each times its interval."""
        return self.local and self.term.form == "integral"

    def rows(
        self, inputs: Sequence[Any], parameters: Sequence[Any], variables: Sequence[Any]
    ) -> tuple[list[Any], list[Any]]:
        """Return the values, and what has to be ≥ 0 for epigraph variables, as expressions on another tape."""
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
        """Return values (points, lanes, values) and epigraph variables (points, lanes, variables), in their units.

        There is a lane a sample where the term is local, else one.
        """
        columns = _columns(motions, self.inputs, self.parameters, self.local)
        table = self.evaluator(_pad(columns, self.motion))
        lanes = table.T.reshape(len(motions), -1, len(table))
        count = len(table) - len(self.units)
        return lanes[..., :count], lanes[..., count:] / self.units


def smooth_term(
    term: Term, task: MotionTask, near: Motion, *, own_times: bool, probes: int = 64, seed: int = 0
) -> SmoothTerm:
    """Return a term as it is for motions like those ``near`` (points, time, dof), which say how large its numbers are.

    Motions are those of ``task``, or, with ``own_times``, of its arm alone. Kinks are looked for at so many ``probes``
    around them. Raises InvalidInput, naming the function, where its derivative cannot be had.
    """
    motion, values = _trace(term, task, own_times)
    tape, local = motion.trace.tape, motion.trace.samples is not None
    outputs = [as_entry(tape, term.factor * value) for value in values]
    parameters = np.array(list(motion.trace.parameters.values())).reshape(-1, len(task.times) if local else 1).T
    inputs = len(tape.inputs) - parameters.shape[1]
    columns = _columns(near, inputs, parameters, local)
    rng, rates = np.random.default_rng(seed), len(ORDERS) * motion.q.entries.size
    size, columns = np.sqrt(np.mean(columns**2, axis=1, keepdims=True)), rng.choice(columns, probes, axis=1)
    probed = columns + size * rng.normal(size=columns.shape)
    probed[rates:] = columns[rates:]  # intervals and parameters stay
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


def _trace(term: Term, task: MotionTask, own_times: bool) -> tuple[TracedMotion, list[Any]]:
    """Return the motion that a term was traced on, of one sample where that will do, and its values."""
    if own_times and term.form in ("integral", "peak"):
        motion = trace_sample(task, own_times=True)
        value = trace_sample_function(motion, term.label, term.function)
        if value is not None:
            return motion, [value]
    motion = trace_motion(task, own_times=own_times)
    values = trace_motion_function(motion, term.label, term.function, term.form)
    if term.form == "integral":
        values = [motion.integral(TracedArray(motion.trace, np.array(values, dtype=object))).entries]
    return motion, values


def _columns(motions: Motion, inputs: int, parameters: np.ndarray, local: bool) -> Float[np.ndarray, "inputs lanes"]:
    """Return inputs and parameters of motions (points, time, dof), lanes sample by sample where it is local."""
    points, samples = motions.q.shape[:2]
    orders = np.stack([getattr(motions, name) for name in ORDERS], axis=2 if local else 1)
    if local:
        durations = np.repeat(motions.duration, samples)[:, None]
        return np.hstack([orders.reshape(points * samples, -1), durations, np.tile(parameters, (points, 1))]).T
    return np.concatenate([orders.reshape(points, -1), np.diff(motions.time)], axis=1).T[:inputs]


def _pad(columns: np.ndarray, motion: TracedMotion) -> np.ndarray:
    """Return inputs and parameters with zeros for the other inputs of the tape."""
    return np.pad(columns, ((0, len(motion.trace.tape.inputs) - len(columns)), (0, 0)))
