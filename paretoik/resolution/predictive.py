"""Predictive minimisation of an objective over a few samples ahead.

Every update computes the positions ahead with the least integral of the objective, and a quartic spline through them.
The steps until the next update follow this spline in the null space of the task.

Source: Tringali & Cocuzza 2021, Table 1.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.autodiff.differentiation import dependencies, gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import Trace
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array, shown
from paretoik.resolution.protocol import (
    TRACKING_TOLERANCE,
    Method,
    Number,
    Parameter,
    ResolvedMotion,
    Traces,
    broadcast_shape,
    empty_traces,
    number,
    step_program,
)
from paretoik.tables import represented
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective, kinetic_energy
from paretoik.task.retraction import retract_nearest
from paretoik.task.task import path_equations, path_jacobian
from paretoik.task.traced_motion import TracedMotion, trace_sample_function

# The nonlinear program of a few samples ahead
#
#     minimise    Σ f(qₖ, q̇ₖ, q̈ₖ) Δt      over q₁ ... q_h, the last sample with a terminal weight
#     subject to  h(qₖ, xₖ) = 0             the path's equations, sample by sample
#
# Rates are backward differences, the first from the given posture and velocity. The program is solved by sequential
# quadratic programming in the null space of the equations' Jacobian, with the exact Hessian of the Lagrangian; every
# step is retracted onto the path. Source: Tringali & Cocuzza 2021, Eq. 4.


DEGREE = 4  # degree of the splines through the positions ahead


@dataclass(frozen=True, kw_only=True, eq=False)
class HorizonSolution:
    """The positions ahead, their objective, whether they are stationary on the path, and the iterations."""

    q: Float[np.ndarray, "horizon dof"]
    value: float
    converged: bool
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class HorizonProgram:
    """Nonlinear program of a few samples ahead.

    horizon: number of samples
    interval: time between samples [s]
    terminal: additional weight of the last sample
    derivatives: evaluator of the objective, its gradient, the path's equations and their Jacobian by samples; the
        inputs are positions ahead, posture, velocity, targets, terminal weight and interval
    hessian: evaluator of the entries of the Lagrangian's Hessian at ``indices`` (rows, columns); multipliers are
        further inputs
    """

    horizon: int
    dof: int
    rows: int
    derivatives: Evaluator
    hessian: Evaluator
    indices: tuple[np.ndarray, np.ndarray]
    interval: float = 1.0
    terminal: float = 0.0

    def inputs(
        self,
        q: Float[np.ndarray, "horizon dof"],
        posture: Float[np.ndarray, " dof"],
        velocity: Float[np.ndarray, " dof"],
        targets: Float[np.ndarray, "horizon numbers"],
    ) -> Float[np.ndarray, "inputs 1"]:
        """Return the inputs of the evaluators; multipliers and jerk are 0."""
        settings, zeros = [self.terminal, self.interval], np.zeros(self.horizon * self.rows + self.dof)
        return np.concatenate([q.ravel(), posture, velocity, targets.ravel(), settings, zeros])[:, None]

    def solve(
        self,
        q: Float[np.ndarray, "horizon dof"],
        posture: Float[np.ndarray, " dof"],
        velocity: Float[np.ndarray, " dof"],
        targets: Float[np.ndarray, "horizon numbers"],
    ) -> HorizonSolution:
        """Return the local minimum found from the positions ahead ``q``, after a posture and its velocity."""
        from paretoik.resolution.horizon_newton import minimise  # here: numba is slow to load

        inputs = self.inputs(q, posture, velocity, targets)
        evaluators = self.derivatives.arrays, self.hessian.arrays
        value, converged, iterations = minimise(*evaluators, *self.indices, inputs, self.horizon, self.dof, self.rows)
        solution = inputs[: q.size].reshape(q.shape)
        return HorizonSolution(q=solution, value=value, converged=converged, iterations=iterations)


def horizon_program(
    task: MotionTask, objective: Objective, horizon: int, interval: float, terminal: float = 0.0
) -> HorizonProgram:
    """Return the program of an objective over samples ahead.

    terminal: additional weight of the last sample

    Raises InvalidInput, naming the objective, if it depends on more than one sample's positions, velocities and
    accelerations, or on none of them.
    """
    return replace(_trace_program(task, objective, horizon), interval=interval, terminal=terminal)


@lru_cache(maxsize=64)  # a search over a method's parameters uses the same few programs repeatedly
def _trace_program(task: MotionTask, objective: Objective, horizon: int) -> HorizonProgram:
    n, label = task.arm.dof, f"objective {objective.name}"
    if objective.form != "integral":
        raise InvalidInput(f"{label}: form must be 'integral', got {shown(objective.form)}")
    trace = Trace(len(task.times))
    tape = trace.tape
    samples = [trace.inputs(n) for _ in range(horizon)]
    posture, velocity = trace.inputs(n), trace.inputs(n)
    targets = [list(trace.inputs(task.targets.shape[1]).entries) for _ in range(horizon)]
    (terminal,), interval = trace.inputs(1).entries, trace.inputs(1)
    multipliers = [trace.inputs(task.rows) for _ in range(horizon)]
    jerk = trace.inputs(n)
    previous, previous_rate = posture, velocity
    total, equations, jacobian = tape.constant(0.0), list[int](), list[int]()
    for q, numbers in zip(samples, targets, strict=True):
        dq = (q - previous) * (1.0 / interval)
        ddq = (dq - previous_rate) * (1.0 / interval)
        previous, previous_rate = q, dq
        motion = TracedMotion(task, trace, q, dq, ddq, jerk, float(np.ptp(task.times)))
        value = trace_sample_function(motion, label, objective.function)
        if value is None:
            raise InvalidInput(f"{label} must depend on one sample only, got one that reads more")
        term = Expression(tape, as_entry(tape, value)) * objective.sign * interval.entries[0]
        total = as_entry(tape, Expression(tape, total) + term)
        positions = list(q.entries)
        equations += [as_entry(tape, one) for one in path_equations(task.arm, task.tasks, positions, numbers)]
        jacobian += [as_entry(tape, one) for one in path_jacobian(task.arm, task.tasks, positions)]
    total = as_entry(tape, Expression(tape, total) + terminal * term)
    read, variables = set(dependencies(tape, [total])), [as_entry(tape, one) for q in samples for one in q.entries]
    if read & {as_entry(tape, one) for one in jerk.entries} or trace.parameters:
        raise InvalidInput(
            f"{label} must read one sample's positions, velocities and accelerations only, got one that reads more"
        )
    if not read & set(variables):
        raise InvalidInput(f"{label} must depend on the motion, got a constant; has {task.arm.name} no masses?")
    lagrangian = Expression(tape, total)
    for factor, equation in zip([one for each in multipliers for one in each.entries], equations, strict=True):
        lagrangian = lagrangian + factor * Expression(tape, equation)
    second = hessian(tape, as_entry(tape, lagrangian), variables)
    indices = np.array(list(second)).reshape(-1, 2).T
    return HorizonProgram(
        horizon=horizon,
        dof=n,
        rows=task.rows,
        derivatives=compile_evaluator(tape, [total, *gradient(tape, total, variables), *equations, *jacobian]),
        hessian=compile_evaluator(tape, list(second.values())),
        indices=(indices[0], indices[1]),
    )


def quartic_spline(
    points: Float[np.ndarray, "points dof"], rate: Float[np.ndarray, " dof"], second: Float[np.ndarray, " dof"]
) -> Float[np.ndarray, "pieces 5 dof"]:
    """Return the coefficients of a C² quartic spline through points one unit of time apart.

    Its derivatives are ``rate`` and ``second`` at the first point, and 0 at the last; if there is only one piece, the
    second derivative at the last point is free. These conditions determine two pieces, as in the paper; with more
    pieces, the jerk is minimised.
    """
    pieces, dof = len(points) - 1, points.shape[1]
    conditions = np.concatenate([points[:-1], points[1:], rate[None], second[None]])
    return (_coefficient_matrix(pieces) @ conditions).reshape(pieces, DEGREE + 1, dof)


def spline_position(coefficients: Float[np.ndarray, "pieces 5 dof"], time: float) -> Float[np.ndarray, " dof"]:
    """Return the spline's position at a time in units of pieces, constant after its end."""
    piece = min(int(time), len(coefficients) - 1)
    u = min(time - piece, 1.0)
    position: np.ndarray = u ** np.arange(DEGREE + 1) @ coefficients[piece]
    return position


@lru_cache(maxsize=32)
def _coefficient_matrix(pieces: int) -> np.ndarray:
    """Return the matrix from positions of pieces' ends and derivatives at the first point to coefficients."""
    width, powers = DEGREE + 1, np.arange(DEGREE + 1)

    def derivative(order: int, u: float) -> np.ndarray:
        factors = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(width)
        return np.asarray(np.where(powers >= order, factors * float(u) ** np.maximum(powers - order, 0), 0.0))

    def condition(*parts: tuple[int, np.ndarray]) -> np.ndarray:
        row = np.zeros((pieces, width))
        for piece, values in parts:
            row[piece] = values
        return row.ravel()

    rows = [condition((i, derivative(0, u))) for u in (0, 1) for i in range(pieces)]
    rows += [condition((0, derivative(order, 0))) for order in (1, 2)]
    inhomogeneous = len(rows)
    rows += [condition((pieces - 1, derivative(order, 1))) for order in ((1, 2) if pieces > 1 else (1,))]
    for i in range(1, pieces):
        rows += [condition((i - 1, derivative(order, 1)), (i, -derivative(order, 0))) for order in (1, 2)]
    jerk = np.zeros((width, width))
    jerk[3:, 3:] = [[36.0, 72.0], [72.0, 192.0]]  # ∫ (6 c₃ + 24 c₄ u)² du
    size, equalities = pieces * width, np.array(rows)
    kkt = np.block([[np.kron(np.eye(pieces), jerk), equalities.T], [equalities, np.zeros((len(rows), len(rows)))]])
    return np.linalg.inv(kkt)[:size, size : size + inhomogeneous]


# The predictive method and its parameters.


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PredictiveKineticEnergy(Method):
    """Minimisation of an objective, by default kinetic energy, over a few samples ahead, in the task's null space.

    objective: integral objective of positions, velocities and accelerations, such as the torque norm
    horizon: number h of samples ahead
    prediction_step: time ΔT between samples ahead [s], None for 0.2 of the path's duration over h
    update_interval: time between predictions [s], None for half the prediction step
    terminal: additional weight of the last sample, for the costs after the horizon
    feedback: gain of the tracking error [1/s]; 0 is open loop, as in the paper

    All these parameters may be arrays (*batch,).

    Raises InvalidInput for numbers out of range. Source: Tringali & Cocuzza 2021, PMKE.
    """

    objective: Objective = kinetic_energy
    horizon: int | np.ndarray = 2
    prediction_step: Number | None = None
    update_interval: Number | None = None
    terminal: Number = field(default=0.0, metadata=number(search=(0.0, 4.0)))
    feedback: Number = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        finite_array("PredictiveKineticEnergy: horizon", self.horizon)
        horizon = np.asarray(self.horizon)
        if horizon.dtype.kind not in "iu" or not (horizon >= 1).all():
            raise InvalidInput(f"PredictiveKineticEnergy: horizon must be 1 sample or more, got {shown(self.horizon)}")
        for name in ("prediction_step", "update_interval"):
            value = getattr(self, name)
            if value is not None and not (finite_array(f"PredictiveKineticEnergy: {name}", value) > 0).all():
                raise InvalidInput(f"PredictiveKineticEnergy: {name} must be more than 0 s, got {shown(value)}")
        if not (finite_array("PredictiveKineticEnergy: feedback", self.feedback) >= 0).all():
            raise InvalidInput(f"PredictiveKineticEnergy: feedback must be 0 or more, got {shown(self.feedback)}")
        if not isinstance(self.objective, Objective):
            raise InvalidInput(f"PredictiveKineticEnergy: objective must be an Objective, got {shown(self.objective)}")

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters tuned by default; raises InvalidInput for fewer than three samples.

        ``prediction_time`` [s] is the horizon times the prediction step; ``update_share`` is the update interval as a
        share of it.
        """
        if len(times) < 3:
            raise InvalidInput(f"path must have at least 3 samples, got {len(times)}")
        return (
            Parameter("horizon", 1, min(6, (len(times) - 1) // 2), scale="integer"),
            Parameter("prediction_time", 0.0, 0.5 * float(times[-1] - times[0])),
            Parameter("update_share", 0.0, 1.0),
            *super().parameters(times),
        )

    def with_values(self, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Self:
        """Return the method with values (motions,) of named parameters, times in whole samples."""
        dt, derived = float(times[1] - times[0]), ("prediction_time", "update_share")
        fields = {name: value for name, value in values.items() if name not in derived}
        horizon = np.asarray(values.get("horizon", self.horizon))
        if "prediction_time" in values:
            stride = np.maximum(np.floor(values["prediction_time"] / dt / horizon + 1e-9), 1)
            fields["prediction_step"] = stride * dt
        elif "prediction_step" in values:
            longest = (len(times) - 1) // horizon
            fields["prediction_step"] = np.clip(np.round(values["prediction_step"] / dt), 1, longest) * dt
        if "update_share" in values:
            step = fields.get("prediction_step", self.prediction_step)
            stride = 0.2 * (times[-1] - times[0]) / horizon / dt if step is None else np.asarray(step) / dt
            fields["update_interval"] = np.maximum(np.round(values["update_share"] * stride * horizon), 1) * dt
        elif "update_interval" in values:
            fields["update_interval"] = np.maximum(np.round(values["update_interval"] / dt), 1) * dt
        return super().with_values(fields, times)

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, as ``follow_predictively`` does."""
        limit = TRACKING_TOLERANCE if tolerance is None else tolerance
        return follow_predictively(task, self, start, tolerance=limit)


# Predictive minimisation along a path.


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class PredictiveTraces(Traces):
    """The traces of predictions, padded with −1 and NaN if other motions have more updates.

    updates: samples of the updates
    predictions: positions ahead (updates, horizon, dof) [rad, m]
    values: minimised objective over the horizon, the last sample with its terminal weight
    converged: whether the prediction is a minimum on the path
    iterations, seconds: iterations and computing time of each update, including the spline
    """

    updates: Int[np.ndarray, "*batch updates"]
    predictions: Float[np.ndarray, "*batch updates horizon dof"]
    values: Float[np.ndarray, "*batch updates"]
    converged: Bool[np.ndarray, "*batch updates"]
    iterations: Int[np.ndarray, "*batch updates"]
    seconds: Float[np.ndarray, "*batch updates"]

    @property
    def evaluations(self) -> Float[np.ndarray, "*batch"]:
        """Mean number of samples that an update evaluates in all iterations."""
        performed = self.updates >= 0
        horizon = np.isfinite(self.predictions[..., 0]).sum(axis=-1).max(axis=-1)
        total = np.where(performed, self.iterations + 1, 0).sum(axis=-1)
        return np.asarray(total / performed.sum(axis=-1) * horizon)


@runtime_checkable
class HorizonSolver(Protocol):
    """A solver for the positions ahead: ``HorizonProgram``, or another in studies."""

    def solve(self, q: np.ndarray, posture: np.ndarray, velocity: np.ndarray, targets: np.ndarray) -> HorizonSolution:
        """Return the minimum found from positions (horizon, dof) after a posture and its velocity."""


MakeSolver = Callable[[MotionTask, Objective, int, float, float], HorizonSolver]
MakeSpline = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Schedule of a motion's predictions, in samples.

    horizon: number of samples ahead
    stride: distance between the samples ahead
    interval: distance between predictions
    terminal: additional weight of the last sample
    """

    horizon: int
    stride: int
    interval: int
    terminal: float

    def updates(self, samples: int) -> list[int]:
        """Return the samples of updates: the first, and others with the whole horizon before the path's end."""
        last = max(samples - 1 - self.horizon * self.stride, 0)
        return list(range(0, last + 1, self.interval))


def schedules(method: PredictiveKineticEnergy, times: np.ndarray, shape: tuple[int, ...]) -> list[Schedule]:
    """Return each motion's schedule; raises InvalidInput for times that are not whole numbers of samples."""
    dt, duration = float(times[1] - times[0]), float(times[-1] - times[0])
    if np.ptp(np.diff(times)) > 1e-9 * dt:
        raise InvalidInput("PredictiveKineticEnergy: path must have evenly spaced times, got uneven ones")
    horizon = np.broadcast_to(method.horizon, shape)
    step = 0.2 * duration / horizon if method.prediction_step is None else method.prediction_step
    interval = np.asarray(step) / 2 if method.update_interval is None else method.update_interval
    result = []
    numbers = horizon, step, interval, np.asarray(method.terminal, dtype=float)
    columns = (np.broadcast_to(each, shape).ravel().tolist() for each in numbers)
    for h, seconds, again, weight in zip(*columns, strict=True):
        stride, period = max(round(seconds / dt), 1), max(round(again / dt), 1)
        for name, value, samples in (("prediction_step", seconds, stride), ("update_interval", again, period)):
            if getattr(method, name) is not None and abs(value / dt - samples) > 1e-6 * samples:
                wish = f"{name} must be whole samples of {dt:g} s"
                raise InvalidInput(f"PredictiveKineticEnergy: {wish}, got {value:g} s")
        if h * stride > len(times) - 1:
            wish = f"horizon must be within the path's {duration:g} s"
            raise InvalidInput(f"PredictiveKineticEnergy: {wish}, got {h} times {stride * dt:g} s")
        result.append(Schedule(horizon=h, stride=stride, interval=period, terminal=weight))
    return result


def follow_predictively(
    task: MotionTask,
    method: PredictiveKineticEnergy,
    start: Float[np.ndarray, "*starts dof"],
    *,
    tolerance: float,
    make_solver: MakeSolver = horizon_program,
    make_spline: MakeSpline = quartic_spline,
) -> ResolvedMotion:
    """Return a predictive motion for each start and each set of parameters.

    If the arm is farther than ``tolerance`` [m, rad] off the path, nothing is predicted: the arm first returns to it.
    Studies pass other solvers and other splines for comparison.
    """
    from paretoik.resolution import step_kernels as kernels  # here: numba is slow to load

    numbers = (method.horizon, method.prediction_step, method.update_interval, method.terminal, method.feedback)
    shape = broadcast_shape(method, start, [np.shape(each) for each in numbers if each is not None])
    dof, times, count = task.arm.dof, task.times, int(np.prod(shape))
    plans, dt = schedules(method, times, shape), float(times[1] - times[0])
    feedback = np.broadcast_to(np.asarray(method.feedback, dtype=float), shape).ravel()
    if feedback.max() * dt > 1 + 1e-12:
        wish = f"feedback must be from 0 to {1 / dt:.4g} 1/s"
        raise InvalidInput(f"PredictiveKineticEnergy: {wish}, got {method.feedback}")
    solvers = {
        each: make_solver(task, method.objective, each.horizon, each.stride * dt, each.terminal) for each in set(plans)
    }
    predictors = [Predictor(task=task, solver=solvers[each], schedule=each, make_spline=make_spline) for each in plans]
    q = np.empty((count, len(times), dof))
    q[:, 0] = np.broadcast_to(start, (*shape, dof)).reshape(count, dof)
    traces = empty_traces(count, len(times), dof, task.rows, 1)
    step = step_program(task, ())
    inputs = np.zeros((4 * dof + step.table.shape[1], count))
    for k in range(len(times)):
        inputs[:dof], inputs[4 * dof :] = q[:, k].T, step.table[k][:, None]
        error, travel, jacobian = np.split(step.program(inputs), [task.rows, 2 * task.rows])
        traces["errors"][:, k] = error.T
        if k == len(times) - 1:
            break
        task_velocity = np.ascontiguousarray((travel / dt + feedback * error).T)
        dq = traces["velocities"][:, k - 1] if k else np.zeros((count, dof))
        ddq = (dq - (traces["velocities"][:, k - 2] if k > 1 else 0.0)) / dt if k else np.zeros((count, dof))
        is_off_path = np.abs(error).max(axis=0) > tolerance
        desired = [
            each.next_position(k, q[i, k], dq[i], ddq[i], is_off_path=bool(is_off_path[i]))
            for i, each in enumerate(predictors)
        ]
        secondary = (np.stack(desired) - q[:, k]) / dt
        outputs = (traces[name] for name in ("velocities", "repulsion", "projected", "status"))
        kernels.step(
            k, dt, np.ascontiguousarray(jacobian.T), np.ascontiguousarray(task_velocity), secondary, q, *outputs
        )
    # traces of updates, of all motions padded to the same number
    updates, horizon = max(len(each.updates) for each in predictors), max(each.horizon for each in plans)
    padding = {"updates": -1, "values": np.nan, "converged": False, "iterations": -1, "seconds": np.nan}
    traces |= {name: np.full((count, updates), empty) for name, empty in padding.items()}
    traces["predictions"] = np.full((count, updates, horizon, dof), np.nan)
    for i, each in enumerate(predictors):
        for u, update in enumerate(each.updates):
            traces["predictions"][i, u, : len(update["predictions"])] = update["predictions"]
            for name in padding:
                traces[name][i, u] = update[name]
    return ResolvedMotion.of(task, shape, q, traces, PredictiveTraces)


class Predictor:
    """The predictions of one motion, from update to update."""

    def __init__(self, *, task: MotionTask, solver: HorizonSolver, schedule: Schedule, make_spline: MakeSpline) -> None:
        self.task, self.solver, self.schedule, self.make_spline = task, solver, schedule, make_spline
        self.updates: list[dict[str, Any]] = []  # traces of each, by name
        self._due = schedule.updates(len(task.times))
        self._origin, self._spline = 0, np.zeros((0, DEGREE + 1, task.arm.dof))

    def next_position(self, k: int, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, *, is_off_path: bool) -> np.ndarray:
        """Return the desired positions at the sample after k, from a new prediction if the update interval is over.

        If the arm is off the path, or the prediction does not reach the sample, they are the positions at k.
        """
        if is_off_path:
            self._spline = self._spline[:0]
        elif self._due and self._due[0] <= k:
            last, self._due = self._due[-1], [update for update in self._due if update > k]
            if k <= last:
                begin = time.perf_counter()
                horizon, stride = self.schedule.horizon, self.schedule.stride
                targets = self.task.targets[k + stride * np.arange(1, horizon + 1)]
                if len(self._spline):
                    instants = (k - self._origin) / stride + np.arange(1, horizon + 1)
                    guess = np.stack([spline_position(self._spline, t) for t in instants.tolist()])
                else:
                    guess = self._initial_guess(q, targets)
                solution = self.solver.solve(guess, q, dq, targets)
                if not solution.converged and len(self._spline):
                    solution = self.solver.solve(self._initial_guess(q, targets), q, dq, targets)
                if solution.converged or not len(self._spline):
                    unit = stride * float(self.task.times[1] - self.task.times[0])
                    points = np.concatenate([q[None], solution.q])
                    self._origin, self._spline = k, self.make_spline(points, unit * dq, unit**2 * ddq)
                self.updates.append(
                    {
                        "updates": k,
                        "predictions": solution.q,
                        "values": solution.value,
                        "converged": solution.converged,
                        "iterations": solution.iterations,
                        "seconds": time.perf_counter() - begin,
                    }
                )
        t = (k + 1 - self._origin) / self.schedule.stride
        return spline_position(self._spline, t) if t <= len(self._spline) else q

    def _initial_guess(self, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Return positions along the path, each nearest to the previous one."""
        guess, current = np.empty((len(targets), len(q))), q
        for j, target in enumerate(targets):
            result = retract_nearest(self.task.arm, self.task.tasks, current, target)
            guess[j] = current = result.q if result.on_path else current
        return guess
