"""Obstacles on the path: where the tool itself cannot keep clear of one, no motion can, whatever the posture."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.robot.kinematics import link_nodes
from paretoik.task.distances import signed_distance
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.task.task import Task
from paretoik.user_warnings import warn_user


def warn_of_obstructed_path(task: MotionTask) -> None:
    """Warn where an obstacle is nearer to the tool's path than links may be to it: no motion is feasible then.

    The tool is the end of the last link, and at every sample where its path has it. No error: the least-violating
    motion may be wanted, and the search for one goes on to name it.
    """
    for followed in task.tasks:
        if task.obstacles and _fixes_tool(task, followed):
            message = _obstruction(task, _tool_positions(task, followed))
            if message:
                warn_user(message)


def obstructed_sample(task: MotionTask, sample: int | None = None) -> int | None:
    """Return a sample at which an obstacle is too near to the tool's path, the worst or the given one; None if none."""
    worst, found = 0.0, None
    for followed in task.tasks if task.obstacles else ():
        if _fixes_tool(task, followed):
            excess = task.min_clearance - _tool_distances(task, _tool_positions(task, followed)).min(axis=0)
            excess = excess if sample is None else excess[[sample]]
            if excess.max() > max(worst, LIMIT_TOLERANCE * task.clearance_range):
                worst, found = float(excess.max()), int(np.argmax(excess)) if sample is None else sample
    return found


def _tool_distances(task: MotionTask, tool: Float[np.ndarray, "time 3"]) -> Float[np.ndarray, "obstacles time"]:
    return np.stack([signed_distance(obstacle, tool, tool) for obstacle in task.obstacles]) - task.link_radius


def _fixes_tool(task: MotionTask, followed: Task) -> bool:
    """Return whether a path says where the tool is, all of its position."""
    follows_tool = task.arm.frame(followed.frame).pose is task.arm.tool
    return follows_tool and (task.arm.is_planar or followed.axes not in ("xy", "xy+angle"))


def _tool_positions(task: MotionTask, followed: Task) -> Float[np.ndarray, "time 3"]:
    points = followed.path.positions
    height = link_nodes(task.arm, np.zeros(task.arm.dof))[-1, 2]
    flat = np.column_stack([points[:, :2], np.full(len(points), height)])
    return flat if task.arm.is_planar else points


def _obstruction(task: MotionTask, tool: Float[np.ndarray, "time 3"]) -> str:
    """Return which obstacle is nearest to the tool, at which sample, and how near links may be; "" if all are clear."""
    distances = _tool_distances(task, tool)
    obstacle, sample = np.unravel_index(int(np.argmin(distances)), distances.shape)
    distance = float(distances[obstacle, sample])
    if task.min_clearance - distance <= LIMIT_TOLERANCE * task.clearance_range:
        return ""
    count = int((distances[obstacle] < task.min_clearance).sum())
    shape = type(task.obstacles[int(obstacle)]).__name__.lower()
    where = f"reaches {-distance:.3g} m into it" if distance < 0 else f"is {distance:.3g} m away from it"
    return (
        f"path: obstacle {obstacle + 1}, a {shape}, is in its way: at sample {sample} ({task.times[sample]:.4g} s), "
        f"the worst of {count}, the end of link {task.arm.dof} (of radius {task.link_radius:g} m) {where}, where a "
        f"clearance of {task.min_clearance:g} m is wanted: no motion along it is feasible"
    )
