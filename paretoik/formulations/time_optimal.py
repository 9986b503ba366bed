"""Time-optimal control as a method whose parameters ``Tuning`` can tune."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass

import numpy as np
from jaxtyping import Float

from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.capability.time_optimal import TimeOptimalRun, time_optimal_control
from paretoik.errors import EvaluationFailed, InvalidInput, SolverFailed
from paretoik.inputs import finite_array, integer_array, shown
from paretoik.resolution.protocol import HELD, STATUS, Method, Number, Parameter, ResolvedMotion, Traces, empty_traces
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest, task_errors


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlTraces(Traces):
    """``Traces`` with two more numbers per motion.

    ``errors`` are relative to the reference. ``velocities`` are finite differences.
    """

    evaluations: Float[np.ndarray, "*batch"]  # mean number of cone programs per plan
    cuts: Float[np.ndarray, "*batch"]  # number of commanded velocities that the model reduced


@dataclass(frozen=True, eq=False, repr=False)
class TimeOptimalControl(Method):
    """Time-optimal control between a path's first and last positions.

    ``model`` limits the tool's speed. The curve between the two positions and the times are free. Motions have as many
    samples as the path, evenly spaced until the tool is at the target. A start sets the first position of the tool. The
    joints follow the tool by the shortest way from one sample to the next. If the control fails, or the arm cannot
    follow, the arm stands still and the error is infinite. Source: Kim, Choi & Jang 2021, Eqs. 6 and 7.

    Parameters
    ----------
    model
        Model of the tool's speed.
    horizon
        Number of pieces of a plan, as in ``time_optimal_control``; may be an array (*batch,).
    period
        Time from one plan to the next [s]; may be an array (*batch,).
    gain
        Gain of the controller [1/s]; may be an array (*batch,).
    tolerance
        Distance from the target [m] at which the motion ends.

    Raises
    ------
    InvalidInput
        If ``model`` is not a speed model, or a number is out of range.
    """

    model: SpeedModel
    _: KW_ONLY
    horizon: int | np.ndarray = 10
    period: Number = 1e-3
    gain: Number = 100.0
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        super().__post_init__()
        check_model(self.model)
        horizon = integer_array("horizon", self.horizon)
        if horizon.size == 0 or horizon.ndim > 1 or not (horizon >= 1).all():
            raise InvalidInput(f"horizon must be at least 1, got {shown(self.horizon)}")
        for name in ("period", "gain", "tolerance"):
            values = finite_array(name, getattr(self, name))
            if values.size == 0 or values.ndim > 1 or not (values > 0).all():
                raise InvalidInput(f"{name} must be above 0, got {shown(getattr(self, name))}")

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters that are tuned by default.

        ``correction``: gain · period: share of an error that is corrected in one period
        """
        if np.ndim(self.period):
            raise InvalidInput(f"TimeOptimalControl: period must be one number, got {self.period}")
        period = float(self.period)
        return (
            Parameter("horizon", 2, 20, scale="integer"),
            Parameter("period", period, 20.0 * period, scale="log"),
            Parameter("correction", 0.02, 1.0),
        )

    def with_values(self, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> TimeOptimalControl:
        """Return the control with values (motions,) of some parameters. Raises InvalidInput for unknown names."""
        changed = dict(values)
        if "correction" in changed:
            changed["gain"] = changed.pop("correction") / changed.get("period", self.period)
        return super().with_values(changed, times)

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return motions from ``start``, broadcast with the parameters; ``tolerance`` has no effect.

        Raises InvalidInput unless the task is one path of positions in the model's dimension.
        """
        if len(task.tasks) != 1 or task.targets.shape[1] != task.rows or task.rows != len(self.model.lower):
            raise InvalidInput(
                f"TimeOptimalControl: path must be one path of positions (..., {len(self.model.lower)}), got "
                f"{len(task.tasks)} with {task.rows} equations"
            )
        numbers = (self.horizon, self.period, self.gain)
        shape = np.broadcast_shapes(start.shape[:-1], *(np.shape(each) for each in numbers))
        q = np.broadcast_to(start, (*shape, task.arm.dof)).reshape(-1, task.arm.dof)
        columns = zip(*(np.broadcast_to(each, shape).ravel().tolist() for each in numbers), strict=True)
        first = task_errors(task.arm, task.tasks, q, np.zeros(task.rows))[0]
        runs = list[TimeOptimalRun | None]()  # None if the control fails
        for tool, (horizon, period, gain) in zip(first, columns, strict=True):
            try:
                run: TimeOptimalRun | None = time_optimal_control(
                    self.model,
                    task.targets[0],
                    task.targets[-1],
                    horizon=horizon,
                    period=period,
                    gain=gain,
                    tolerance=self.tolerance,
                    initial=-tool,
                )
            except (EvaluationFailed, SolverFailed):
                run = None
            runs.append(run)
        return _joint_motion(task, shape, q, runs)


def _joint_motion(
    task: MotionTask, shape: tuple[int, ...], start: np.ndarray, runs: list[TimeOptimalRun | None]
) -> ResolvedMotion:
    """Return the joint motions that follow the tool of every run, with as many samples as the task."""
    count, samples, dof = len(runs), len(task.times), task.arm.dof
    shares = np.linspace(0.0, 1.0, samples)
    time = np.tile(task.times, (count, 1))
    tool, references = np.tile(task.targets[0], (2, count, samples, 1))
    for i, run in enumerate(runs):
        if run is not None:
            time[i] = shares * run.settled
            for positions, column in ((run.positions, tool[i]), (run.references, references[i])):
                column[:] = np.stack([np.interp(time[i], run.times, each) for each in positions.T], axis=1)
    q, reached = np.tile(start[:, None], (1, samples, 1)), np.array([run is not None for run in runs])
    for k in range(1, samples):
        result = retract_nearest(task.arm, task.tasks, q[:, k - 1], tool[:, k])
        reached &= result.on_path
        q[:, k] = np.where(reached[:, None], result.q, q[:, k - 1])
    traces = empty_traces(count, samples, dof, task.rows, 1)
    errors = task_errors(task.arm, task.tasks, q, references)[0]
    traces["errors"][:] = np.where(reached[:, None, None], errors, np.inf)
    traces["velocities"][:] = np.diff(q, axis=1) / np.diff(time, axis=1)[..., None]
    traces["status"][~reached] = HELD
    plans = [np.nan if run is None or not len(run.iterations) else float(run.iterations.mean()) for run in runs]
    extra = {"evaluations": np.array(plans), "cuts": np.array([0 if run is None else run.cuts for run in runs], float)}
    arrays = {name: each.reshape(*shape, *each.shape[1:]) for name, each in {**traces, **extra}.items()}
    return ResolvedMotion(
        arm=task.arm,
        time=time.reshape(*shape, samples),
        q=q.reshape(*shape, samples, dof),
        obstacles=task.obstacles,
        link_radius=task.link_radius,
        differences=task.differences,
        traces=ControlTraces(**{**arrays, "status": STATUS[arrays["status"]]}),
    )
