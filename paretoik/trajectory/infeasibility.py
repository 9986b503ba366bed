"""Limits that cannot all hold: whether that is clear already, which of them it is, and in what words."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from paretoik.errors import Infeasible
from paretoik.robot.kinematics import link_nodes
from paretoik.self_motion.start_postures import sample_postures
from paretoik.task.distances import clearance
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


@dataclass(frozen=True, kw_only=True)
class InfeasibilityOptions:
    """When it is clear that limits cannot all hold.

    ``clear`` is the violation [share of a range] of rates and torques that is left on a coarse level and that no finer
    one mends. Positions and clearance are looked at in so many ``postures`` of the
    worst sample: it is clear where all of them violate one by more than ``clear_posture``.
    """

    clear: float = 0.1
    postures: int = 256
    clear_posture: float = 0.02


OPTIONS = InfeasibilityOptions()

REMEDIES = {  # by kind of limit: what may make room for a motion
    "position": "another place of the path, or fewer axes of the task",
    "velocity": "a longer duration",
    "acceleration": "a longer duration",
    "torque": "a longer duration, or a smaller payload",
    "power": "a longer duration",
    "clearance": "obstacles or a path elsewhere, a smaller link_radius or Limits(clearance=)",
}


def is_clearly_infeasible(task: MotionTask, motion: Motion) -> bool:
    """Return whether a least-violating motion shows that no motion keeps all limits; it is no proof."""
    violations = task.violations(motion)
    if not len(violations) or violations.max() <= 0:
        return False
    name = task.limit_names[int(np.argmax(violations))]
    kind = name.partition(" of ")[0]
    if kind not in ("position", "clearance"):
        return kind in task.bounds and bool(violations.max() > OPTIONS.clear)
    _, violation = _posture_violations(task, int(np.argmax(violations)), motion)
    return len(violation) > 0 and bool(violation.min() > OPTIONS.clear_posture)


def remedy_text(task: MotionTask, motion: Motion) -> str:
    """Return what may help where a least-violating motion breaks a limit: "; it may help: ...", "" for a user's own.

    It begins with how many postures were tried at the worst sample where none of them keeps the limit.
    """
    violations = task.violations(motion)
    if not len(violations) or not violations.max() > 0:
        return ""
    worst = int(np.argmax(violations))
    kind = task.limit_names[worst].partition(" of ")[0]
    if kind not in REMEDIES or (kind != "clearance" and kind not in task.bounds):
        return ""
    text = f"; it may help: {REMEDIES[kind]}"
    if kind in ("position", "clearance"):
        sample, violation = _posture_violations(task, worst, motion)
        if len(violation) > 1 and violation.min() > 0:
            return f"; none of {len(violation)} postures tried at sample {sample} keeps the limits{text}"
    return text


def explain_violation(task: MotionTask, motion: Motion) -> str:
    """Return which limit a motion violates most, where, by how much, and what may help; "" where it keeps them all."""
    return task.describe_violation(motion) + remedy_text(task, motion)


def infeasible_error(
    task: MotionTask, level: MotionTask, motion: Motion, *, obstructed: bool, status: str
) -> Infeasible:
    """Return the error of limits that cannot all hold, of the least-violating motion on a level of a task.

    ``obstructed`` says that there is a motion where obstacles are left out; ``status`` is how the solver ended. Samples
    go by their numbers in the task.
    """
    violations = level.violations(motion)
    limit = level.limit_names[int(np.argmax(violations))] if level.limit_names else ""
    message = "no motion within the limits was found"
    if obstructed and limit != "clearance":
        message, limit = f"{message}, though there is one without the obstacles", "clearance"
    numbers, full = np.searchsorted(task.times, level.times), _at_samples(task, motion)
    return Infeasible(
        f"{message}; of the least-violating one, {level.describe_violation(motion, numbers) or status}"
        + remedy_text(task, full),
        motion=full,
        limit=limit,
        violation=float(violations.max(initial=0.0)),
    )


def without_obstacles(task: MotionTask) -> MotionTask:
    """Return the task in empty space."""
    return replace(task, obstacles=())


def _at_samples(task: MotionTask, motion: Motion) -> Motion:
    """Return a motion of a coarser level at the task's own samples, as far as it stays on the path there."""
    if motion.q.shape[-2] == len(task.times):
        return motion
    try:
        return task.motion(motion.at(task.times))
    except Infeasible:
        return motion


def _postures(task: MotionTask, sample: int) -> np.ndarray:
    """Return postures that reach a sample, joints that turn in the turn next to the middle of their limits."""
    q = sample_postures(task, OPTIONS.postures, np.random.default_rng(0), sample=sample)
    limits = task.arm.position_limits
    middle = np.where(np.isfinite(limits).all(axis=1, keepdims=True), limits, 0.0).mean(axis=1)
    turns = np.where(task.arm.periodic, np.round((q - middle) / (2 * np.pi)), 0.0)
    return np.asarray(q - 2 * np.pi * turns)


def _posture_violations(task: MotionTask, limit: int, motion: Motion) -> tuple[int, np.ndarray]:
    """Return the sample where a motion violates a limit most, and what postures (postures,) that reach it violate."""
    sample = task.worst_sample(limit, motion)
    q = motion.q[sample : sample + 1] if task.start is not None and sample == 0 else _postures(task, sample)
    return sample, _posture_violation(task, sample, q)


def _posture_violation(task: MotionTask, sample: int, q: np.ndarray) -> np.ndarray:
    """Return the worst violation (postures,) of position limits and of clearance, as shares of their ranges."""
    worst = np.zeros(len(q))
    if "position" in task.bounds:
        bounds = task.bounds["position"]
        here = bounds[min(sample, len(bounds) - 1)]
        lower, upper = here.T
        ranges = task.limit_ranges("position", here)
        worst = np.maximum(worst, (np.maximum(q - upper, lower - q) / ranges).max(axis=1))
    if task.obstacles:
        distance = clearance(task.obstacles, link_nodes(task.arm, q), task.link_radius)
        worst = np.maximum(worst, (task.min_clearance - distance) / task.clearance_range)
    return worst
