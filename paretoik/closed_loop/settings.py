"""What a closed loop is given, checked: weights, limits, a start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from paretoik.closed_loop.workspace import SLACK
from paretoik.errors import InvalidInput
from paretoik.front.preferences import Weights
from paretoik.inputs import finite_array
from paretoik.robot.kinematics import link_nodes
from paretoik.task.distances import clearance
from paretoik.task.limits import Limits
from paretoik.task.motion_task import MotionTask


def nearest_obstacle(task: MotionTask, q: np.ndarray) -> str:
    """Return in words which obstacle is nearest to a configuration."""
    nodes = link_nodes(task.arm, q)
    gaps = [float(clearance([obstacle], nodes, task.link_radius)) for obstacle in task.obstacles]
    k = int(np.argmin(gaps))
    return f"obstacle {k + 1} of {len(gaps)}, {task.obstacles[k]}"


def settled_weights(
    given: Weights | Sequence[float] | np.ndarray | None, names: tuple[str, ...]
) -> Float[np.ndarray, " n_obj"]:
    """Return weights in the order of the names, their sum 1; equal ones for None. Raises InvalidInput for others."""
    if isinstance(given, Weights):
        unknown = [name for name in given.weights if name not in names]
        if unknown:
            raise InvalidInput(f"weights: wanted names among {', '.join(names)}, got {unknown[0]!r}")
        given = [given.weights.get(name, 0.0) for name in names]
    weights = np.ones(len(names)) if given is None else finite_array("weights", given, shape=(len(names),))
    if (weights < 0).any() or weights.sum() <= 0:
        raise InvalidInput(f"weights: none below 0 and one above it wanted, got {weights.tolist()}")
    return np.asarray(weights / weights.sum())


def check_limits(limits: Limits | None) -> None:
    """Raise InvalidInput for limits that a closed loop does not keep."""
    for kind in ("acceleration", "torque", "power") if limits is not None else ():
        given = getattr(limits, kind)
        if given is not None and not (isinstance(given, float) and given == np.inf):
            raise InvalidInput(f"limits: of position, velocity and clearance wanted in a closed loop, got {kind}")


def settled_start(task: MotionTask, start: Sequence[float] | np.ndarray) -> Float[np.ndarray, " dof"]:
    """Return joint positions to begin in. Raises InvalidInput where they are beyond a limit or meet an obstacle."""
    q: np.ndarray = finite_array("start", start, shape=(task.arm.dof,))
    low, high = task.arm.position_limits.T
    beyond = np.flatnonzero((q < low - SLACK) | (q > high + SLACK))
    if beyond.size:
        k = int(beyond[0])
        raise InvalidInput(
            f"start: {task.arm.joint_names[k]} must lie within {low[k]:.6g} to {high[k]:.6g}, got {q[k]:.6g}"
        )
    if task.obstacles:
        gap = float(clearance(task.obstacles, link_nodes(task.arm, q), task.link_radius)) - task.min_clearance
        if gap <= 0:
            raise InvalidInput(f"start: must be clear of obstacles, got {gap:.3g} m from {nearest_obstacle(task, q)}")
    return q
