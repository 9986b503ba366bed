"""The nonlinear program of a motion: what its objectives and limits are at a sample, with exact derivatives.

The variables of a sample are u = (q, q̇, q̈, q⃛), linear in the positions q of a few samples (``Stencil``), and slacks v
where functions have kinks; peaks have a variable σ for the whole motion. Integral objectives are sums over samples of
functions of these; limits bound u itself, or further functions such as torque. The path is an equation in q at every
sample. What looks from one sample at another is a function of the whole motion (``Whole``).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.kinks import Reformulation, reformulate_choices, reformulate_kinks
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.errors import InvalidInput
from paretoik.nlp.program import Linearisation
from paretoik.robot.kinematics import link_frames
from paretoik.task.limits import limit_ranges as widths
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract, row_space_basis, task_errors
from paretoik.trajectory.compiled.motion_kernel import MotionKernel
from paretoik.trajectory.functions import Functions, Total, functions
from paretoik.trajectory.stencil import Stencil, stencil
from paretoik.trajectory.whole_functions import Whole

ORDERS = ("position", "velocity", "acceleration", "jerk")
PROBES = 64  # places at which slopes are looked at for kinks
REMEMBERED = 16  # programs: levels of samples and scalings of objectives share them
SPREAD = (2.0, 1.0, 3.0, 10.0)  # rad, rad/s, ... at the probes


@dataclass(frozen=True, kw_only=True, eq=False)
class Slopes:
    """Which derivatives are not always 0: those of function ``function`` by variable ``variable``."""

    function: Int[np.ndarray, " entries"]
    variable: Int[np.ndarray, " entries"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProgram:
    """Everything that a solver needs of a MotionTask.

    ``totals`` are the numbers of a whole motion: the objectives, divided by ``scales``, then bounded ones.
    ``inputs`` (rows, time) has a row for each input of the programs: u first, then what is known, and at
    ``multipliers`` those of path equations, sums and rows. ``variables`` says which rows u, v and σ are: there are
    ``slacks`` v and ``peaks`` σ. ``slack`` gives v where it is what it stands for. ``value`` gives sums and rows;
    ``slope`` also their ``slopes`` by variables; ``curvature`` the ``second`` derivatives of the Lagrangian by u and v;
    ``track`` path equations and their Jacobian. ``limited`` (limits, 2) are the variable, or the row beyond those, and
    the sample that each limit bounds at ``bounds``, from below where its side is 1, and whose violations are shares of
    ``ranges``; the last ``kinks`` of them tie v and σ. Row ``under[i]``, a kink, is that of peak ``over[i]``.
    """

    task: MotionTask
    scales: Float[np.ndarray, " n_obj"]
    stencil: Stencil
    totals: tuple[Total, ...]
    inputs: Float[np.ndarray, "inputs time"]
    variables: Int[np.ndarray, " variables"]
    slacks: int
    peaks: int
    multipliers: Int[np.ndarray, 3]
    sums: int
    rows: tuple[str, ...]
    under: Int[np.ndarray, " under"]
    over: Int[np.ndarray, " under"]
    slack: Evaluator
    value: Evaluator
    slope: Evaluator
    slopes: Slopes
    curvature: Evaluator
    second: Slopes
    track: Evaluator
    limited: Int[np.ndarray, "limits 2"]
    sides: Float[np.ndarray, " limits"]
    bounds: Float[np.ndarray, " limits"]
    ranges: Float[np.ndarray, " limits"]
    kinks: int
    wholes: tuple[Whole, ...]

    @property
    def is_smooth(self) -> bool:
        """Whether all totals are sums of smooth functions of a sample, so that compiled code can take it."""
        return not (self.slacks or self.peaks or self.wholes)

    @property
    def elastic(self) -> int:
        """Number of limits: the inequalities that come before those that tie slack and epigraph variables."""
        return len(self.sides) - self.kinks

    @property
    def upper(self) -> Float[np.ndarray, " totals"]:
        """What the totals may not exceed."""
        return np.array([total.upper for total in self.totals])

    @property
    def objective_names(self) -> tuple[str, ...]:
        """Names of the totals, the task's objectives first."""
        return tuple(total.name for total in self.totals)

    @property
    def inequality_names(self) -> tuple[str, ...]:
        """Names of the limits, each a function of a sample; see ``limited``."""
        kinds = [f"{order} of {joint}" for order in ORDERS for joint in self.task.arm.joint_names]
        simple = kinds[: len(self.stencil.weights) * self.task.arm.dof]
        names = [*simple, *[""] * (len(self.variables) - len(simple)), *self.rows]
        return tuple(names[row] for row in self.limited[: self.elastic, 0])

    @property
    def kinked(self) -> tuple[str, ...]:
        """Names of totals that are peaks or functions of the whole motion, or what else has kinks in general."""
        names = tuple(total.name for total in self.totals if total.kind != "sum")
        return names or ("an absolute value, maximum or minimum",) * bool(self.slacks)

    @property
    def rounding(self) -> float:
        """Stationarity that is rounding: where a motion stops, how its last sample follows is known up to a step."""
        return 1e-6 if self.task.ends_at_rest else 0.0

    def project(self, x: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
        """Return motions that begin at the start and end at rest, where they have to."""
        return self.pin(end_at_rest(self.task, x) if self.task.ends_at_rest else x)

    def pin(self, x: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
        """Return motions that begin at the start, where one is given, to the bit."""
        if self.task.start is None:
            return x
        q = x.copy()
        q[:, 0] = self.task.start  # leading back to the path may have rounded it
        return q

    def evaluate(
        self, x: Float[np.ndarray, "time dof"]
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h, which is empty, motions being on the path, and c, the limits divided by their ranges."""
        from paretoik.trajectory.evaluation import evaluate  # here: it builds on this file

        values = evaluate(self, x)
        return values.objectives, np.zeros(0), values.inequalities

    def linearise(self, x: Float[np.ndarray, "time dof"]) -> Linearisation:
        """Return the program to first order at a motion on the path."""
        from paretoik.trajectory.linearisation import linearise  # here: it builds on this file

        return linearise(self, x)

    def distance(
        self, x: Float[np.ndarray, "time dof"], others: Float[np.ndarray, "others time dof"]
    ) -> Float[np.ndarray, " others"]:
        """Return how far a motion is from others [rad, m], RMS over time, angles modulo 2π."""
        return joint_distance(self.task, x, others)

    @property
    def kernel(self) -> MotionKernel | None:
        """The program as interior points take it, None for the SQP; each has registers of its own: one for a thread."""
        if not self.is_smooth:
            return None
        return MotionKernel(
            value=self.value.arrays,
            slope=self.slope.arrays,
            slope_of=self.slopes.function,
            slope_by=self.slopes.variable,
            curvature=self.curvature.arrays,
            second_i=self.second.function,
            second_j=self.second.variable,
            track=self.track.arrays,
            neighbours=self.stencil.window,
            coefficients=self.stencil.weights,
            first_unknown=self.stencil.place,
            unknowns=self.stencil.unknowns,
            border=self.stencil.seam,
            stops=self.task.ends_at_rest,
            ones=np.ones(len(self.task.times)),
            quadrature=np.array(self.task.weights),
            inputs=self.inputs,
            multipliers=self.multipliers,
            limited=self.limited,
            sides=self.sides,
            bounds=self.bounds,
        )


def end_at_rest(task: MotionTask, q: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
    """Return motions whose last step is the shortest that the path allows: they end without self-motion."""
    targets = np.tile(task.targets[-1], (len(q), 1))
    directions = row_space_basis(task_errors(task.arm, task.tasks, q[:, -1], targets)[1])
    retracted = retract(task.arm, task.tasks, q[:, -2], targets, directions)
    ends = np.where(retracted.on_path[:, None], retracted.q, q[:, -1])
    return np.concatenate([q[:, :-1], ends[:, None]], axis=1)


def joint_distance(task: MotionTask, q: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "*batch"]:
    """Return the RMS over time of the joint distance [rad, m] between motions (..., time, dof), angles modulo 2π."""
    difference = q - other
    difference = np.where(task.arm.periodic, (difference + np.pi) % (2 * np.pi) - np.pi, difference)
    return np.asarray(np.sqrt(np.mean(np.sum(difference**2, axis=-1), axis=-1)))


def motion_program(task: MotionTask, scales: Sequence[float] | np.ndarray | None = None) -> MotionProgram:
    """Return the nonlinear program of a task, its objectives divided by ``scales``.

    Raises InvalidInput, naming the objective or limit, where there is none.
    """
    if task.ends_at_rest and task.differences == "central":
        raise InvalidInput("end_velocity=0: differences='backward' is wanted where motions are polished, got 'central'")
    divisors = np.ones(len(task.objectives)) if scales is None else np.asarray(scales, dtype=float)
    shares = 1.0 / divisors
    asked = functions(task, shares)
    path = _path(asked)
    known = _derived(asked, path)
    samples, extra = len(task.times), known.slacks + len(asked.tops)
    orders = _orders(task, known.slopes.variable[known.slopes.variable < 4 * task.arm.dof], asked.wholes)
    gone = (4 - orders) * task.arm.dof  # rates that nothing looks at are left out
    inputs = np.zeros((known.inputs, samples))
    for i, values in asked.motion.trace.parameters.items():
        inputs[asked.motion.trace.tape.entries[i][1]] = values
    ties = len(asked.under) + known.ties
    bounds = [*asked.bounds, *[np.tile([0.0, np.inf], (samples, 1))] * ties]
    limited, sides, limits, ranges = _limits(task, orders, extra, bounds)
    return MotionProgram(
        task=task,
        scales=divisors,
        stencil=stencil(task, orders),
        totals=tuple(asked.totals),
        inputs=inputs,
        variables=np.append(np.arange(orders * task.arm.dof), known.extra),
        slacks=known.slacks,
        peaks=len(asked.tops),
        multipliers=known.multipliers,
        sums=len(asked.sums),
        rows=tuple(asked.names),
        under=len(asked.rows) + np.arange(len(asked.under)),
        over=np.array(asked.over, dtype=np.int64),
        slack=known.slack,
        value=known.value,
        slope=known.slope,
        slopes=_closed_up(known.slopes, task.arm.dof, gone, by_functions=True),
        curvature=known.curvature,
        second=_closed_up(known.second, task.arm.dof, gone),
        track=known.track,
        limited=limited,
        sides=sides,
        bounds=limits,
        ranges=ranges,
        kinks=ties * samples,
        wholes=tuple(asked.wholes),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Derived:
    """The programs of functions and path equations; see ``MotionProgram``. Variables: all four orders, v, σ."""

    slacks: int
    ties: int
    inputs: int
    extra: Int[np.ndarray, " extra"]
    multipliers: Int[np.ndarray, 3]
    slack: Evaluator
    value: Evaluator
    slope: Evaluator
    slopes: Slopes
    curvature: Evaluator
    second: Slopes
    track: Evaluator


_KNOWN: OrderedDict[Any, _Derived] = OrderedDict()


def _derived(asked: Functions, path: list[int]) -> _Derived:
    """Return the programs of functions and path: those that are known where the same was written down before."""
    tape, parts = asked.motion.trace.tape, (asked.sums, asked.rows, asked.under, asked.tops, path)
    sides = [tuple(np.isfinite(bounds).any(axis=0)) for bounds in asked.bounds]
    key = (tuple(tape.entries), tuple(tape.values.items()), tuple(map(tuple, parts)), tuple(sides))
    if key not in _KNOWN:
        _KNOWN[key] = _differentiated(asked, path)
        if len(_KNOWN) > REMEMBERED:
            _KNOWN.popitem(last=False)
    _KNOWN.move_to_end(key)
    return _KNOWN[key]


def _differentiated(asked: Functions, path: list[int]) -> _Derived:
    tape, n = asked.motion.trace.tape, asked.motion.arm.dof
    plain = _without_kinks(asked)
    every = [*plain.functions, *plain.constraints]
    multipliers = len(tape.inputs) + np.cumsum([0, len(path), len(asked.sums)])
    factors = [tape.input() for _ in range(len(path) + len(every))]
    lagrangian: Any = 0.0
    for factor, f in zip(factors, (*path, *every), strict=True):
        lagrangian = lagrangian + factor * Expression(tape, f)
    u, extra = list(tape.inputs[: 4 * n]), [*plain.epigraph_variables, *asked.tops]
    first = [gradient(tape, f, [*u, *extra]) for f in every]
    nothing = tape.constant(0.0)
    slopes = [(k, j, slope) for k, row in enumerate(first) for j, slope in enumerate(row) if slope != nothing]
    second = hessian(tape, as_entry(tape, lagrangian), [*u, *plain.epigraph_variables])
    jacobian = [slope for h in path for slope in gradient(tape, h, u[:n])]
    return _Derived(
        slacks=len(plain.epigraph_variables),
        ties=len(plain.constraints),
        inputs=len(tape.inputs),
        extra=np.array([tape.entries[i][1] for i in extra], dtype=np.int64),
        multipliers=multipliers,
        slack=compile_evaluator(tape, plain.nodes),
        value=compile_evaluator(tape, every),
        slope=compile_evaluator(tape, [*every, *(slope for *_, slope in slopes)]),
        slopes=_places([(k, j) for k, j, _ in slopes]),
        curvature=compile_evaluator(tape, list(second.values())),
        second=_places(list(second)),
        track=compile_evaluator(tape, [*path, *jacobian]),
    )


def _without_kinks(asked: Functions) -> Reformulation:
    """Return sums, rows and what lies under peaks without the kinks that matter."""
    tape, rng = asked.motion.trace.tape, np.random.default_rng(0)
    probes = np.zeros((len(tape.inputs), PROBES))
    dof = asked.motion.arm.dof
    for order, spread in enumerate(SPREAD):
        probes[order * dof : (order + 1) * dof] = spread * rng.normal(size=(dof, PROBES))
    for i, values in asked.motion.trace.parameters.items():
        probes[tape.entries[i][1]] = rng.choice(values, PROBES)
    sides = [1] * len(asked.sums)
    for bounds in asked.bounds:
        low, high = np.isfinite(bounds).any(axis=0)
        sides.append(int(high) - int(low))
    sides += [-1] * len(asked.under)
    peaks = [total.name for total in asked.totals if total.kind == "peak"]
    names = [total.name for total in asked.totals if total.kind == "sum"]
    names += [*asked.names, *(peaks[k] for k in asked.over)]
    left = asked.distances
    plain = reformulate_choices(tape, [*asked.sums, *asked.rows, *asked.under], names, probes, left)
    return reformulate_kinks(tape, plain, sides, probes, left)


def _path(asked: Functions) -> list[int]:
    """Return the entries of the path's equations."""
    motion, task = asked.motion, asked.motion.task
    targets = task.targets.copy()
    if task.cyclic:
        targets[-1] = targets[0]
    wanted: list[Any] = [motion.trace.parameter(column) for column in targets.T]
    links, begun = link_frames(task.arm, list(motion.q.entries)), 0
    path: list[int] = []
    for part in task.tasks:
        path += [
            as_entry(motion.trace.tape, h) for h in part.equations(task.arm, links, wanted[begun:][: part.target_size])
        ]
        begun += part.target_size
    return path


def _orders(task: MotionTask, used: np.ndarray, wholes: Sequence[Whole]) -> int:
    """Return how many of position, velocity, acceleration and jerk anything looks at."""
    n, samples = task.arm.dof, len(task.times)
    local = [int(j) // n for j in used] + [ORDERS.index(kind) for kind in task.bounds if kind in ORDERS]
    return 1 + max([1, *local, *(int(by) // (n * samples) for each in wholes for by in each.by)])


def _limits(
    task: MotionTask, orders: int, extra: int, rows: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    samples, n = len(task.times), task.arm.dof
    free = np.tile([-np.inf, np.inf], (samples, n, 1))
    simple = [np.broadcast_to(task.bounds.get(kind, free), free.shape) for kind in ORDERS[:orders]]
    none = np.tile([-np.inf, np.inf], (samples, extra, 1))
    both = np.concatenate([*simple, none, *(row[:, None] for row in rows)], axis=1)
    which, sample, side = np.nonzero(np.isfinite(both.transpose(1, 0, 2)))  # kinks last
    if task.start is not None:
        moves = (sample > 0) | (which >= n)
        which, sample, side = which[moves], sample[moves], side[moves]
    width = widths(both[sample, which, 0], both[sample, which, 1])
    return np.stack([which, sample], axis=1), 1.0 - 2.0 * side, both[sample, which, side], width


def _closed_up(pairs: Slopes, dof: int, gone: int, *, by_functions: bool = False) -> Slopes:
    """Return places without the orders that are not there."""
    rows, columns = (np.where(part >= 4 * dof, part - gone, part) for part in (pairs.function, pairs.variable))
    return Slopes(function=pairs.function if by_functions else rows, variable=columns)


def _places(pairs: list[tuple[int, int]]) -> Slopes:
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return Slopes(function=np.ascontiguousarray(table[:, 0]), variable=np.ascontiguousarray(table[:, 1]))
