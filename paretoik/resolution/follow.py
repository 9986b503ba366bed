"""Follow a path by a method, as far as it can be followed: one motion for each start and set of numbers."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.resolution.batch import broadcast, compiled_kernels, position_ranges
from paretoik.resolution.methods import (
    Method,
    Nedungadi,
    PredictiveKineticEnergy,
    VelocityMethod,
    WeightedGradientProjection,
    WeightedLeastNorm,
)
from paretoik.resolution.predictive import follow_predictively
from paretoik.resolution.step_program import step_program
from paretoik.resolution.traces import HELD, ResolvedMotion, empty_traces
from paretoik.resolution.variational import extremal_paths
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

TRACKING_TOLERANCE = 0.01  # m or rad: a motion farther off its path has lost it


def follow(
    task: MotionTask, method: Method, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
) -> ResolvedMotion:
    """Return the motions of a method from ``start``, broadcast against its numbers.

    ``tolerance`` [m, rad], 0.01 by default, is the distance from the path beyond which nothing is predicted.
    Raises InvalidInput for what is no method, and for starts and numbers that cannot be used.
    """
    if isinstance(method, Nedungadi):
        return _follow_extremal(task, method, start)
    if isinstance(method, PredictiveKineticEnergy):
        limit = TRACKING_TOLERANCE if tolerance is None else tolerance
        return follow_predictively(task, method, start, tolerance=limit)
    if isinstance(method, VelocityMethod):
        return _follow_velocities(task, method, start)
    raise InvalidInput(f"resolve: wants a method, such as PseudoInverse(), got {method!r}")


def _follow_velocities(task: MotionTask, method: VelocityMethod, start: np.ndarray) -> ResolvedMotion:
    """Return the motions of a velocity method, on all cores."""
    criteria, steps = method.criterion_list, np.diff(task.times)
    batch = broadcast(method, criteria, start, steps)
    program = step_program(task, [each.objective for each in criteria])
    count, dof, number = len(batch.start), task.arm.dof, len(criteria)
    q = np.empty((count, len(task.times), dof))
    q[:, 0] = batch.start
    traces = empty_traces(count, len(task.times), dof, task.rows, number)
    bounds = task.bounds.get("position", task.arm.position_limits[None])
    bounds = np.concatenate([bounds, position_ranges(task.arm, bounds)[..., None]], axis=-1)
    scaling = np.array([[each.objective.sign, each.reference, each.scale] for each in criteria]).reshape(number, 3)
    settings = _modes(method), batch.settings, batch.gains, scaling
    outputs = (q, *traces.values())

    def run(first: int, last: int) -> None:
        compiled_kernels().follow(first, last, program.program.arrays, program.table, steps, bounds, *settings, outputs)

    threads = max(min(os.cpu_count() or 1, count), 1)
    cuts = np.linspace(0, count, threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, cuts[:-1], cuts[1:]))
    return ResolvedMotion.of(task, batch.shape, q, traces)


def _modes(method: VelocityMethod) -> tuple[int, bool, bool]:
    """Return how joints are weighted, whether the projector is the paper's, and whether criteria are normalised."""
    kernels = compiled_kernels()
    if isinstance(method, WeightedGradientProjection):
        return kernels.CLAMPING, method.variant == "paper", True
    return kernels.LEAST_NORM if isinstance(method, WeightedLeastNorm) else kernels.UNWEIGHTED, False, False


def _follow_extremal(task: MotionTask, method: Nedungadi, start: np.ndarray) -> ResolvedMotion:
    """Return the motions of stationary kinetic energy; they stand still where they run into a singularity.

    The task's share of their velocities is the shortest, the rest is traced as projected.
    """
    shape = np.broadcast_shapes(start.shape[:-1], np.shape(method.tolerance))
    start, dof, samples = np.broadcast_to(start, (*shape, task.arm.dof)), task.arm.dof, len(task.times)
    tolerance = np.broadcast_to(method.tolerance, shape).ravel()
    q, rates = extremal_paths(task, start.reshape(-1, dof), tolerance=tolerance)
    complete = np.isfinite(q).all(axis=2)
    last = np.where(complete, np.arange(samples), 0).max(axis=1)  # motions end at their first incomplete sample
    index = np.minimum(np.arange(samples), last[:, None])
    q = np.take_along_axis(q, index[..., None], axis=1)
    dq = np.where(complete[..., None], rates, 0.0)[:, :-1]
    traces = empty_traces(len(q), samples, dof, task.rows, 1)
    errors, jacobians = task_errors(task.arm, task.tasks, q.reshape(-1, dof), np.tile(task.targets, (len(q), 1)))
    traces["errors"][:] = errors.T.reshape(len(q), samples, -1)
    jacobian = np.moveaxis(jacobians, -1, 0).reshape(len(q), samples, task.rows, dof)[:, :-1]
    traces["velocities"][:] = dq
    traces["status"][~complete[:, 1:]] = HELD
    shortest = np.linalg.pinv(jacobian) @ (jacobian @ dq[..., None])
    traces["projected"][:, :, 0] = dq - shortest[..., 0]
    return ResolvedMotion.of(task, shape, q, traces)
