"""Methods that follow a path as far as possible: one motion for each start and set of numbers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.resolution.constrained import ACTIVE, ConstrainedTraces, follow_constrained
from paretoik.resolution.methods import (
    ConstrainedQP,
    Criterion,
    Method,
    Nedungadi,
    PredictiveKineticEnergy,
    VelocityMethod,
    WeightedGradientProjection,
    WeightedLeastNorm,
)
from paretoik.resolution.predictive import compiled_kernels, follow_predictively
from paretoik.resolution.protocol import HELD, ResolvedMotion, broadcast_shape, empty_traces, step_program
from paretoik.resolution.variational import extremal_paths
from paretoik.task.limits import position_ranges
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

SETTINGS = "region", "damping", "buffer", "repulsion", "band"  # columns after the feedback, 0 for methods without them
TRACKING_TOLERANCE = 0.01  # m or rad: a motion farther off its path has lost it


def follow(
    task: MotionTask, method: Method, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
) -> ResolvedMotion:
    """Return the motions of a method from ``start``, broadcast against its numbers.

    ``tolerance`` [m, rad], 0.01 by default, is the distance from the path above which nothing is predicted. Raises
    InvalidInput for other methods, and for starts and numbers that cannot be used.
    """
    if isinstance(method, Nedungadi):
        return _follow_extremal(task, method, start)
    if isinstance(method, PredictiveKineticEnergy):
        limit = TRACKING_TOLERANCE if tolerance is None else tolerance
        return follow_predictively(task, method, start, tolerance=limit)
    if isinstance(method, VelocityMethod):
        return _follow_velocities(task, method, start)
    raise InvalidInput(f"method must be one of pk.methods, such as PseudoInverse(), got {shown(method)}")


def _follow_velocities(task: MotionTask, method: VelocityMethod, start: np.ndarray) -> ResolvedMotion:
    criteria, steps = method.criterion_list, np.diff(task.times)
    shape, settings, gains = _broadcast(method, criteria, start, steps)
    count, dof, number = len(settings), task.arm.dof, len(criteria)
    q = np.empty((count, len(task.times), dof))
    q[:, 0] = np.broadcast_to(start, (*shape, dof)).reshape(-1, dof)
    traces = empty_traces(count, len(task.times), dof, task.rows, number)
    if isinstance(method, ConstrainedQP):
        follow_constrained(task, method, settings, gains, q, traces)
        traces["active"] = ACTIVE[traces["active"]]
        return ResolvedMotion.of(task, shape, q, traces, ConstrainedTraces)
    program = step_program(task, tuple(each.objective for each in criteria))
    bounds = task.bounds.get("position", task.arm.position_limits[None])
    bounds = np.concatenate([bounds, position_ranges(task.arm, bounds)[..., None]], axis=-1)
    scaling = np.array([[each.objective.sign, each.reference, each.scale] for each in criteria]).reshape(number, 3)
    inputs = program.table, steps, bounds, _modes(method), settings, gains, scaling
    outputs = (q, *traces.values())

    def run(first: int, last: int) -> None:
        arrays = program.program.arrays  # with its own workspace: one per thread
        compiled_kernels().follow(first, last, arrays, *inputs, outputs)

    threads = max(min(os.cpu_count() or 1, count), 1)
    cuts = np.linspace(0, count, threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, cuts[:-1], cuts[1:]))
    return ResolvedMotion.of(task, shape, q, traces)


def _broadcast(
    method: VelocityMethod, criteria: Sequence[Criterion], start: np.ndarray, steps: np.ndarray
) -> tuple[tuple[int, ...], Float[np.ndarray, "motions columns"], Float[np.ndarray, "motions criteria 2"]]:
    """Return the batch's shape, each motion's feedback and ``SETTINGS``, and its gains and ranks of criteria from 0.

    Raises InvalidInput if numbers do not fit each other.
    """
    name, highest = type(method).__name__, 1.0 / float(steps.max())
    feedback = np.asarray(highest if method.feedback is None else method.feedback, dtype=float)
    if not ((feedback >= 0) & (feedback <= highest * (1 + 1e-12))).all():
        raise InvalidInput(
            f"{name}: feedback must be from 0 to {highest:.4g} 1/s, one over the longest step, got {method.feedback}"
        )
    numbers = [feedback, *(np.asarray(getattr(method, each, 0.0), dtype=float) for each in SETTINGS)]
    numbers += [np.asarray(each.gain, dtype=float) for each in criteria]
    priorities = getattr(method, "priorities", None)
    ranks = np.arange(len(criteria)) if priorities is None else np.argsort(np.argsort(priorities, axis=-1), axis=-1)
    if ranks.shape[-1:] != (len(criteria),):
        raise InvalidInput(f"{name}: priorities must be one for each of {len(criteria)} criteria, got {ranks.shape}")
    shape = broadcast_shape(method, start, [ranks.shape[:-1], *(each.shape for each in numbers)])
    columns = np.stack([np.broadcast_to(each, shape).ravel() for each in numbers], axis=1)
    settings, gains = np.split(columns, [1 + len(SETTINGS)], axis=1)
    ranks = np.broadcast_to(ranks, (*shape, len(criteria))).reshape(gains.shape)
    return shape, np.ascontiguousarray(settings), np.stack([gains, ranks.astype(float)], axis=2)


def _modes(method: VelocityMethod) -> tuple[int, bool, bool]:
    """Return the kind of joint weights, whether the projector is the paper's, and whether criteria are normalised."""
    kernels = compiled_kernels()
    if isinstance(method, WeightedGradientProjection):
        return kernels.CLAMPING, method.variant == "paper", True
    return kernels.LEAST_NORM if isinstance(method, WeightedLeastNorm) else kernels.UNWEIGHTED, False, False


def _follow_extremal(task: MotionTask, method: Nedungadi, start: np.ndarray) -> ResolvedMotion:
    """Return the motions of stationary kinetic energy; they stop if they run into a singularity.

    In the traces the task's part of the velocities is the shortest one, the rest is ``projected``.
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
    traces["errors"][:], jacobian = task_errors(task.arm, task.tasks, q, task.targets)
    jacobian = jacobian[:, :-1]
    traces["velocities"][:] = dq
    traces["status"][~complete[:, 1:]] = HELD
    shortest = np.linalg.pinv(jacobian) @ (jacobian @ dq[..., None])
    traces["projected"][:, :, 0] = dq - shortest[..., 0]
    return ResolvedMotion.of(task, shape, q, traces)
