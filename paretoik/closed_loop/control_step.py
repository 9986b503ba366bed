"""One control step: where it begins, what it is to reach, how far it may go (Marcos et al. 2012, section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.robot.kinematics import link_nodes
from paretoik.task.distances import clearance
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

HISTORY = 3  # configurations before a step: enough for a jerk


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlStep:
    """The step to sample ``sample`` of the path, before it is taken.

    ``history`` are the last joint positions, the present ones last; ``home`` are those in which the loop began;
    ``lower`` and ``upper`` [rad, m] bound how far each joint may move; ``swept`` says that the whole step is to be
    clear of obstacles, not its end alone, which then keeps a ``standoff`` [m].
    """

    task: MotionTask
    sample: int
    history: Float[np.ndarray, "history dof"]
    home: Float[np.ndarray, " dof"]
    lower: Float[np.ndarray, " dof"]
    upper: Float[np.ndarray, " dof"]
    swept: bool
    standoff: float

    @property
    def previous(self) -> Float[np.ndarray, " dof"]:
        """The joint positions in which the step begins."""
        return self.history[-1]

    @property
    def dt(self) -> float:
        """Duration of the step [s]."""
        return float(self.task.times[self.sample] - self.task.times[self.sample - 1])

    @property
    def target(self) -> Float[np.ndarray, " numbers"]:
        """What the tool is to reach, as ``MotionTask.targets`` gives it."""
        return self.task.targets[self.sample]

    def linearise(self) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows dof"]]:
        """Return (Δx, J): the error of the tool before the step, and the Jacobian there (Eqs. 8 and 9)."""
        return task_errors(self.task.arm, self.task.tasks, self.previous, self.target)


def rotation_rows(task: MotionTask) -> Bool[np.ndarray, " rows"]:
    """Return which rows of the task errors are rotations [rad]."""
    return np.concatenate([np.arange(each.rows) >= each.position_rows for each in task.tasks])


def reach_by_joint(task: MotionTask) -> Float[np.ndarray, " dof"]:
    """Return the most [m] that any point of the arm moves when a joint moves by 1 rad or 1 m.

    No point beyond a joint is farther from it than the stretched length of all that follows. A sliding joint moves
    what it carries as far as itself; its largest extension adds to the length beyond the joints before it.
    """
    arm = task.arm
    offsets = [float(np.linalg.norm(place.position)) for place in (*arm.placements[1:], arm.tool)]
    slides = ~arm.periodic
    extension = np.where(slides, np.abs(arm.position_limits).max(axis=1), 0.0)
    lengths = np.cumsum((offsets + np.append(extension[1:], 0.0))[::-1])[::-1]
    return np.where(slides, 1.0, lengths)


def excess_clearance(task: MotionTask, q: Float[np.ndarray, " dof"]) -> float:
    """Return by how much [m] a configuration exceeds the required clearance from the obstacles; inf without any."""
    if not task.obstacles:
        return np.inf
    return float(clearance(task.obstacles, link_nodes(task.arm, q), task.link_radius)) - task.min_clearance


def describe_nearest_obstacle(task: MotionTask, q: Float[np.ndarray, " dof"]) -> str:
    """Return in words which obstacle is nearest to a configuration."""
    nodes = link_nodes(task.arm, q)
    distances = [float(clearance([obstacle], nodes, task.link_radius)) for obstacle in task.obstacles]
    k = int(np.argmin(distances))
    return f"obstacle {k + 1} of {len(distances)}, {task.obstacles[k]}"
