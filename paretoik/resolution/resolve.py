"""Resolution of one motion along a path by a method, with checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from paretoik.collision.obstacles import Obstacle, clearance, closest_pair
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput
from paretoik.inputs import ArrayLike, check_choice, check_seed, degrees_hint, finite_array, shown
from paretoik.resolution.constrained import ConstrainedTraces
from paretoik.resolution.methods import (
    ConstrainedQP,
    Method,
    Nedungadi,
    PredictiveKineticEnergy,
    VelocityMethod,
)
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import link_nodes
from paretoik.task.limits import LIMIT_TOLERANCE, Limits
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import joint_travel
from paretoik.task.path import Path
from paretoik.task.random_starts import reach_error, sample_postures
from paretoik.task.retraction import task_errors
from paretoik.task.task import Task, describe_errors, error_unit
from paretoik.task.validation import motion_task

LOST_STEPS = {
    "held": "no velocities satisfy the task",
    "shortened": "a joint would move more than 1 rad or m in the step",
    "limited": "limits leave no velocities that satisfy the task",
}
Unreachable = Literal["refuse", "track"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Resolution:
    """A checked request of ``paretoik.resolve``: a task, a method, starts (*batch, dof), and its settings."""

    task: MotionTask
    method: Method
    starts: Float[np.ndarray, "*batch dof"]
    unreachable: Unreachable
    tolerance: float


def resolution_of(
    arm: Arm,
    path: Path | Task | Sequence[Path | Task],
    method: Method,
    *,
    start: object,
    limits: Limits | None,
    obstacles: Sequence[Obstacle],
    link_radius: ArrayLike,
    unreachable: Unreachable,
    tolerance: float,
    seed: int,
) -> Resolution:
    """Return the checked request; raises InvalidInput, naming an unusable part, and OutOfReach."""
    if not isinstance(method, VelocityMethod | PredictiveKineticEnergy | Nedungadi):
        raise InvalidInput(f"method must be one of pk.methods, such as PseudoInverse(), got {shown(method)}")
    check_choice("unreachable", unreachable, get_args(Unreachable))
    if not finite_array("tolerance", tolerance, ()) > 0:
        raise InvalidInput(f"tolerance must be a positive distance in m or rad, got {tolerance}")
    check_seed("seed", seed)
    task = motion_task(
        arm,
        path,
        objectives=[each.objective for each in method.criterion_list] or [joint_travel],
        limits=limits,
        obstacles=obstacles,
        link_radius=link_radius,
        differences="backward",
    )
    starts = _starts(task, start, seed)
    if isinstance(method, ConstrainedQP):
        # refuse limits that rates cannot satisfy, and starts beyond limits
        first = starts.reshape(-1, arm.dof)[: None if unreachable == "refuse" else 0]
        for kind in ("torque", "power"):
            if getattr(limits, kind, None) is not None:
                wish = "must be on position, velocity, acceleration and clearance"
                raise InvalidInput(f"limits of ConstrainedQP {wish}, got {kind}")
        lower, upper = task.bounds.get("position", task.arm.position_limits[None])[0].T
        excess = np.maximum(first - upper, lower - first).max(axis=0, initial=-np.inf)
        if (excess > LIMIT_TOLERANCE).any():
            joint = int(excess.argmax())
            raise InvalidInput(
                "start: joints must be within their position limits for ConstrainedQP, got "
                f'{task.arm.joint_names[joint]} {excess[joint]:.3g} beyond; unreachable="track" brings it back'
            )
        if task.obstacles and first.size:
            smallest = float(clearance(task.obstacles, link_nodes(task.arm, first), task.link_radius).min())
            if smallest < task.min_clearance - LIMIT_TOLERANCE:
                raise InvalidInput(
                    f"start: links must be {task.min_clearance:g} m clear of obstacles for ConstrainedQP, got "
                    f'{smallest:.3g} m; unreachable="track" moves away from them'
                )
    return Resolution(task=task, method=method, starts=starts, unreachable=unreachable, tolerance=tolerance)


def resolve(resolution: Resolution) -> ResolvedMotion:
    """Return the motion of a request.

    Unless ``unreachable`` is "track", raises Infeasible if the path is lost, EvaluationFailed if a criterion is not
    finite.
    """
    task, criteria, tolerance = resolution.task, resolution.method.criterion_list, resolution.tolerance
    motion = resolution.method.follow(task, resolution.starts, tolerance=tolerance)
    if resolution.unreachable == "track":
        return motion
    steps, count = len(task.times) - 1, max(len(criteria), 1)
    missing = np.isnan(motion.traces.coefficients).reshape(-1, steps, count).any(axis=0)
    if criteria and missing.any():
        sample, index = np.argwhere(missing)[0]
        raise EvaluationFailed(
            f"criterion {criteria[index].objective.name} must have a finite value and gradient, got none at sample "
            f'{sample} ({task.times[sample]:.3g} s); unreachable="track" leaves it out there'
        )
    # The first sample at which a motion loses its path.
    dof, samples = task.arm.dof, len(task.times)
    errors = np.abs(motion.traces.errors).max(axis=-1).reshape(-1, samples)
    broken = np.zeros_like(errors, dtype=bool)
    status = motion.traces.status.reshape(-1, samples - 1)
    broken[:, 1:] = np.isin(status, list(LOST_STEPS))
    off_path = broken | (errors > tolerance)
    if not off_path.any():
        return motion
    i = int(np.argmax(off_path.any(axis=1)))
    sample = int(np.argmax(off_path[i]))
    before = max(sample - 1, 0)
    q = motion.q.reshape(-1, samples, dof)[i, before]
    jacobian = task_errors(task.arm, task.tasks, q, task.targets[before])[1]
    index = np.unravel_index(i, motion.q.shape[:-2])
    name = f"motion {', '.join(str(int(k)) for k in index)}: " if index else ""
    distance = describe_errors(task.tasks, motion.traces.errors.reshape(-1, samples, task.rows)[i, sample])
    if sample == 0:
        hint = degrees_hint(q[task.arm.periodic])
        raise InvalidInput(
            f"resolve: {name}start must be at most {tolerance:g} {error_unit(task.tasks)} off the path's first sample, "
            f'got {distance}; unreachable="track" allows it{f"; {hint}" if hint else ""}'
        )
    cause = LOST_STEPS[str(status[i, sample - 1])] if broken[i, sample] else f"{distance} off the path"
    active = ""
    if status[i, before] == "limited":  # the active limits of a constrained step to a sample
        assert isinstance(motion.traces, ConstrainedTraces)
        limits = motion.traces.active.reshape(-1, *motion.traces.active.shape[-2:])[i, sample - 1]
        words = [f"{limit} of {joint}" for limit, joint in zip(limits, task.arm.joint_names, strict=False) if limit]
        if limits[-1]:
            links = motion.links.reshape(-1, *motion.links.shape[-3:])[i, sample]
            words.append(f"clearance between {closest_pair(task.obstacles, links, task.link_radius)}")
        active = " and ".join(words)
        cause += f": {active}" if active else ""
    raise Infeasible(
        f"resolve: {name}{cause} at sample {sample} ({task.times[sample]:.3g} s), where the Jacobian's condition "
        f'number is {np.linalg.cond(jacobian):.3g}; unreachable="track" follows the path as well as possible',
        motion=motion,
        limit=active,
    )


def _starts(task: MotionTask, start: object, seed: int) -> np.ndarray:
    """Return the start postures (*batch, dof).

    Without a start, it is the posture farthest from singular among 64 samples, if possible within limits.
    """
    if start is None:
        rng = np.random.default_rng(seed)
        candidates = sample_postures(task, 64, rng)
        if not len(candidates):
            raise reach_error(task, rng, 0)
        singular_values = np.linalg.svd(task_errors(task.arm, task.tasks, candidates, task.targets[0])[1])[1]
        lower, upper = task.bounds.get("position", task.arm.position_limits[None])[0].T
        within = ((candidates >= lower) & (candidates <= upper)).all(axis=1)
        return np.asarray(candidates[np.argmax(singular_values.min(axis=1) + 1e3 * within)])
    q = finite_array("start", start)
    if q.ndim == 0 or q.shape[-1] != task.arm.dof or not q.size:
        raise InvalidInput(f"start must be joint positions (..., {task.arm.dof}), got shape {q.shape}")
    return q
