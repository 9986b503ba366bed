"""Predictive minimisation of an objective over a few samples ahead.

Every update computes the positions ahead with the least integral of the objective (``horizon``), and a quartic spline
through them. The steps until the next update follow this spline in the null space of the task.

Source: Tringali & Cocuzza 2021, Table 1.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array, shown
from paretoik.resolution.horizon import DEGREE, HorizonSolution, horizon_program, quartic_spline, spline_position
from paretoik.resolution.parameters import Number, Parameter, number
from paretoik.resolution.protocol import (
    TRACKING_TOLERANCE,
    Method,
    ResolvedMotion,
    Traces,
    broadcast_shape,
    empty_traces,
    step_program,
)
from paretoik.tables import field_representation, html_representation
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective, kinetic_energy
from paretoik.task.retraction import retract_nearest

# The predictive method and its numbers.


Predictive = TypeVar("Predictive", bound="PredictiveKineticEnergy")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PredictiveKineticEnergy(Method):
    """Minimisation of kinetic energy over a few samples ahead.

    It takes place in the null space of the task.

    objective: integral objective of positions, velocities and accelerations, such as the torque norm
    horizon: number h of samples ahead
    prediction_step: time ΔT between samples ahead [s], None for 0.2 of the path's duration over h
    update_interval: time between predictions [s], None for half the prediction step
    terminal: additional weight of the last sample, for the costs after the horizon
    feedback: gain of the tracking error [1/s]; 0 is open loop, as in the paper

    All numbers may be arrays (*batch,).

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
        """Return the numbers searched by default; raises InvalidInput for fewer than three samples.

        ``prediction_time`` [s] is the horizon times the prediction step, ``update_share`` the update interval over it.
        """
        if len(times) < 3:
            raise InvalidInput(f"path must have at least 3 samples, got {len(times)}")
        return (
            Parameter("horizon", 1, min(6, (len(times) - 1) // 2), scale="integer"),
            Parameter("prediction_time", 0.0, 0.5 * float(times[-1] - times[0])),
            Parameter("update_share", 0.0, 1.0),
            *super().parameters(times),
        )

    def with_values(
        self: Predictive, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]
    ) -> Predictive:
        """Return the method with values (motions,) for some numbers, times in whole samples."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictiveTraces(Traces):
    """The traces of predictions, padded with −1 and NaN if others have more updates.

    updates: samples of the updates
    predictions: positions ahead (updates, horizon, dof) [rad, m]
    values: minimised objective over the horizon, the last sample with its terminal weight
    converged: whether the prediction is a minimum on the path
    iterations, seconds: effort of each update, including the spline
    """

    updates: Int[np.ndarray, "*batch updates"]
    predictions: Float[np.ndarray, "*batch updates horizon dof"]
    values: Float[np.ndarray, "*batch updates"]
    converged: Bool[np.ndarray, "*batch updates"]
    iterations: Int[np.ndarray, "*batch updates"]
    seconds: Float[np.ndarray, "*batch updates"]

    __repr__ = field_representation
    _repr_html_ = html_representation

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
    """The schedule of a motion's predictions, in samples.

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
        raise InvalidInput("PredictiveKineticEnergy: path must have samples evenly spaced in time, got others")
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
    """Return a predictive motion for each start and each set of numbers.

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
        task_velocity = (travel / dt + feedback * error).T
        dq = traces["velocities"][:, k - 1] if k else np.zeros((count, dof))
        ddq = (dq - (traces["velocities"][:, k - 2] if k > 1 else 0.0)) / dt if k else np.zeros((count, dof))
        is_off_path = np.abs(error).max(axis=0) > tolerance
        desired = [
            each.next_position(k, q[i, k], dq[i], ddq[i], is_off_path=bool(is_off_path[i]))
            for i, each in enumerate(predictors)
        ]
        secondary = (np.stack(desired) - q[:, k]) / dt
        outputs = (traces[name] for name in ("velocities", "repulsion", "projected", "status"))
        kernels.step(k, dt, np.ascontiguousarray(jacobian.T), task_velocity, secondary, q, *outputs)
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
        """Return the desired positions at the sample after k, from a new prediction if one is due.

        They are those at k if the arm is off the path, or if the prediction does not reach the sample.
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
        """Return positions along the path, each nearest to the position before."""
        guess, current = np.empty((len(targets), len(q))), q
        for j, target in enumerate(targets):
            result = retract_nearest(self.task.arm, self.task.tasks, current, target)
            guess[j] = current = result.q if result.on_path else current
        return guess
