"""One motion along a path, resolved by a method: the verb, and what comes out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, get_args

import numpy as np

from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput, check_size
from paretoik.resolution.batch import engine, lanes, ranges
from paretoik.resolution.methods import (
    Criterion,
    GradientProjection,
    Method,
    Nedungadi,
    PredictiveKineticEnergy,
    VelocityMethod,
    WeightedGradientProjection,
    WeightedLeastNorm,
)
from paretoik.resolution.predictive import predicted
from paretoik.resolution.step_program import step_program
from paretoik.resolution.traces import ResolvedMotion, resolved
from paretoik.resolution.variational import variational
from paretoik.robot.arm import Arm
from paretoik.robot.pose import finite_array
from paretoik.self_motion.postures import reach_error as out_of_reach
from paretoik.self_motion.postures import sample_postures
from paretoik.task.limits import Limits
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import joint_travel
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.retraction import task_errors
from paretoik.task.task import Task

TOLERANCE = 0.01  # m or rad: a motion farther off its path has not followed it
BROKEN = {
    "held": "no velocities do what the task wants",
    "shortened": "a joint were to go more than 1 rad or m in the step",
}
TRIED = 64  # postures, of which a motion starts in the one farthest from singular
Unreachable = Literal["refuse", "track"]


def resolve(
    arm: Arm,
    path: Path | Task | Sequence[Path | Task],
    method: Method,
    *,
    start: object = None,
    limits: Limits | None = None,
    obstacles: Sequence[Obstacle] = (),
    link_radius: float = 0.0,
    unreachable: Unreachable = "refuse",
    tolerance: float = TOLERANCE,
    seed: int = 0,
) -> ResolvedMotion:
    """Return the motion by which a method follows a path.

    Parameters
    ----------
    arm, path
        A redundant arm, and a path or tasks for it.
    method
        ``PseudoInverse``, ``DampedLeastSquares``, ``WeightedLeastNorm``, ``GradientProjection``,
        ``WeightedGradientProjection``, ``LeastSquaresVelocity``, ``PredictiveKineticEnergy`` or ``Nedungadi``.
    start
        Joint positions (*batch, dof) to start in; by default a posture on the path's first sample, within the limits if
        one is found there, that is far from singular. Starts and the method's numbers are broadcast against each
        other: one motion for each.
    limits
        Position limits that methods keep joints from; the arm's own by default. A joint with one limit counts as having
        a range of 2π rad, or 1 m. No method promises to keep them.
    obstacles, link_radius
        What criteria may look at.
    unreachable
        What to do where the path is lost: to "refuse" it, or to "track" it as well as can be.
    tolerance
        The distance [m, rad] from the path at which it counts as lost; so far off nothing is predicted either.
    seed
        Of the postures that the default start is chosen from.

    ``unreachable`` and ``tolerance`` mean nothing to ``Nedungadi``, whose motions are on the path or refused; a start
    less than 1e-6 off the path is led onto it.

    The task's velocity over a step is that of its target, with a pose the angular velocity of the target's frame, plus
    feedback. The task is given up for a step ("held") where the Jacobian, its joints weighed, is singular and nothing
    is damped, and a step is shortened where a joint were to go more than 1 rad or m in it. Where a path leaves what can
    be reached, the arm follows as it can and returns with it; it takes more damping than the default, or less feedback,
    to keep it calm meanwhile.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where there is no start.
    Infeasible
        Where the path is lost and ``unreachable="refuse"``, with sample, error and the Jacobian's condition number.
    EvaluationFailed
        Where a criterion gives no number and ``unreachable="refuse"``.

    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.3678, 0.0], duration=1.0, samples=101)
    >>> motion = resolve(pk.arms.tringali_3r(), path, pk.methods.PseudoInverse(), start=[0.0, 0.327, -0.754])
    >>> motion.q.shape
    (101, 3)
    """
    if not isinstance(method, VelocityMethod | PredictiveKineticEnergy | Nedungadi):
        raise InvalidInput(f"resolve: wants a method, such as PseudoInverse(), got {method!r}")
    if unreachable not in get_args(Unreachable):
        raise InvalidInput(f"unreachable must be one of {', '.join(get_args(Unreachable))}, got {unreachable!r}")
    if not finite_array("tolerance", tolerance, ()) > 0:
        raise InvalidInput(f"tolerance: a positive distance in m or rad wanted, got {tolerance}")
    check_size("seed", seed, 0)
    criteria = method.settled if isinstance(method, GradientProjection) else ()
    task = motion_task(
        arm,
        path,
        objectives=[each.objective for each in criteria] or [joint_travel],
        limits=limits,
        obstacles=obstacles,
        link_radius=link_radius,
    )
    q = _starts(task, start, seed)
    if isinstance(method, Nedungadi):
        return _stationary(task, method, q)
    if isinstance(method, PredictiveKineticEnergy):
        motion = predicted(task, method, q, tolerance=tolerance)
    else:
        motion = _followed(task, method, criteria, q)
    if unreachable == "refuse":
        _check_criteria(task, motion, criteria)
        _check_followed(task, motion, tolerance)
    return motion


def _starts(task: MotionTask, given: object, seed: int) -> np.ndarray:
    """Return the postures (*batch, dof) that motions start in."""
    if given is None:
        rng = np.random.default_rng(seed)
        found = sample_postures(task, TRIED, rng)
        if not len(found):
            raise out_of_reach(task, rng, 0)
        slopes = np.moveaxis(
            task_errors(task.arm, task.tasks, found, np.tile(task.targets[0], (len(found), 1)))[1], -1, 0
        )
        lower, upper = task.bounds.get("position", task.arm.position_limits[None])[0].T
        inside = ((found >= lower) & (found <= upper)).all(axis=1)
        return np.asarray(found[np.argmax(np.linalg.svd(slopes)[1].min(axis=1) + 1e3 * inside)])
    try:
        q = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"start: joint positions (..., {task.arm.dof}) wanted, got {given!r}") from None
    if q.ndim == 0 or q.shape[-1] != task.arm.dof or not q.size:
        raise InvalidInput(f"start: joint positions (..., {task.arm.dof}) wanted, got shape {q.shape}")
    return finite_array("start", q)


def _followed(
    task: MotionTask, method: VelocityMethod, criteria: Sequence[Criterion], start: np.ndarray
) -> ResolvedMotion:
    """Return the motions of a method, one for each of its starts and numbers, on all cores."""
    steps = np.diff(task.times)
    asked, program = lanes(method, criteria, start, steps), step_program(task, [c.objective for c in criteria])
    count, size, n, c = len(asked.start), len(steps), task.arm.dof, len(criteria)
    q = np.empty((count, size + 1, n))
    q[:, 0] = asked.start
    traces = resolved(count, size + 1, n, task.rows, c)
    bounds = task.bounds.get("position", task.arm.position_limits[None])
    bounds = np.concatenate([bounds, ranges(task.arm, bounds)[..., None]], axis=-1)
    signs = np.array([[one.objective.sign, one.reference, one.scale] for one in criteria]).reshape(c, 3)
    modes, found = _modes(method), (q, *traces.values())

    def follow(first: int, last: int) -> None:
        given = program.table, steps, bounds, modes, asked.settings, asked.gains, signs, found
        engine().followed(first, last, program.written.arrays, *given)

    threads = max(min(os.cpu_count() or 1, count), 1)
    cuts = np.linspace(0, count, threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(follow, cuts[:-1], cuts[1:]))
    return ResolvedMotion.of(task, asked.batch, q, traces)


def _stationary(task: MotionTask, method: Nedungadi, start: np.ndarray) -> ResolvedMotion:
    """Return the motions of stationary kinetic energy; the task's share of their velocities is the shortest."""
    found = variational(task, start, tolerance=method.tolerance)
    n, samples = task.arm.dof, len(task.times)
    q, dq = found.motion.q.reshape(-1, samples, n), found.dq.reshape(-1, samples, n)[:, :-1]
    traces = resolved(len(q), samples, n, task.rows, 1)
    flat, targets = q.reshape(-1, n), np.tile(task.targets, (len(q), 1))
    errors, slopes = task_errors(task.arm, task.tasks, flat, targets)
    traces["errors"][:] = errors.T.reshape(len(q), samples, -1)
    jacobian = np.moveaxis(slopes, -1, 0).reshape(len(q), samples, task.rows, n)[:, :-1]
    traces["velocities"][:] = dq
    onto = np.linalg.pinv(jacobian) @ (jacobian @ dq[..., None])
    traces["projected"][:, :, 0] = dq - onto[..., 0]
    return ResolvedMotion.of(task, start.shape[:-1], q, traces)


def _modes(method: VelocityMethod) -> tuple[int, bool, bool]:
    """Return how joints are weighed, whether the projector is the paper's, and whether criteria are normalised."""
    known = engine()
    if isinstance(method, WeightedGradientProjection):
        return known.CLAMPING, method.variant == "paper", True
    return known.LEAST_NORM if isinstance(method, WeightedLeastNorm) else known.ALIKE, False, False


def _check_criteria(task: MotionTask, motion: ResolvedMotion, criteria: Sequence[Criterion]) -> None:
    """Raise EvaluationFailed where a criterion gave no number, with the first sample where it did not."""
    missing = np.isnan(motion.traces.coefficients).reshape(-1, len(task.times) - 1, max(len(criteria), 1)).any(axis=0)
    if criteria and missing.any():
        sample, which = np.argwhere(missing)[0]
        raise EvaluationFailed(
            f"criterion {criteria[which].objective.name}: wants a finite value and gradient, got none at sample "
            f'{sample} ({task.times[sample]:.3g} s); unreachable="track" leaves it out there'
        )


def _check_followed(task: MotionTask, motion: ResolvedMotion, tolerance: float) -> None:
    """Raise Infeasible where a motion lost its path, with the first sample where it did."""
    n, time = task.arm.dof, len(task.times)
    errors = np.abs(motion.traces.errors).max(axis=-1).reshape(-1, time)
    broken = np.zeros_like(errors, dtype=bool)
    status = motion.traces.status.reshape(-1, time - 1)
    broken[:, 1:] = np.isin(status, list(BROKEN))
    lost = broken | (errors > tolerance)
    if not lost.any():
        return
    lane = int(np.argmax(lost.any(axis=1)))
    sample = int(np.argmax(lost[lane]))
    before = max(sample - 1, 0)
    q = motion.q.reshape(-1, time, n)[lane, [before]]
    slopes = task_errors(task.arm, task.tasks, q, task.targets[[before]])[1][..., 0]
    batch = np.unravel_index(lane, motion.q.shape[:-2])
    which = f"motion {', '.join(str(int(i)) for i in batch)}: " if batch else ""
    if sample == 0:
        raise InvalidInput(
            f"resolve: {which}start is {errors[lane, 0]:.3g} m (or rad) off the path's first sample; wants at most "
            f'{tolerance:g}, or unreachable="track"'
        )
    off = f"{errors[lane, sample]:.3g} m or rad off the path"
    what = BROKEN[str(status[lane, sample - 1])] if broken[lane, sample] else off
    raise Infeasible(
        f"resolve: {which}{what} at sample {sample} ({task.times[sample]:.3g} s), where the Jacobian's condition "
        f'number is {np.linalg.cond(slopes):.3g}; unreachable="track" goes on as well as can be'
    )
