"""What a motion is made of, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np

from paretoik.arrays import JointPaths
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_flag, check_instance, finite_number, read_list, real_array
from paretoik.robot.arm import Arm, check_arm
from paretoik.task.differences import Differences
from paretoik.task.obstacles import Obstacle
from paretoik.task.spline import Derivatives
from paretoik.task.task import Task

if TYPE_CHECKING:  # a motion has itself checked here
    from paretoik.task.motion import Motion


def checked_samples(arm: Arm, q: object, time: object) -> tuple[JointPaths, np.ndarray]:
    """Return the samples of a motion and their times as floats; raises InvalidInput where they are those of none."""
    check_arm("motion: arm", arm)
    positions, times = real_array("motion: q", q), real_array("motion: time", time)
    if positions.ndim < 2 or positions.shape[-1] != arm.dof:
        raise InvalidInput(f"motion of {arm.name}: q wants shape (..., time, {arm.dof}), got {positions.shape}")
    if positions.shape[-2] < 3 or times.shape not in (positions.shape[-2:-1], positions.shape[:-1]):
        fact = f"got {times.shape} for {positions.shape}"
        raise InvalidInput(f"motion: q and time want one time a sample and at least 3, {fact}")
    for name, values in (("position", positions), ("time", times[..., None])):
        invalid = np.argwhere(~np.isfinite(values))
        if len(invalid):
            got = values[tuple(invalid[0])]
            raise InvalidInput(f"motion: every {name} must be finite, got {got} at sample {invalid[0][-2]}")
    decreasing = np.argwhere(np.diff(times) <= 0)
    if len(decreasing):
        k = decreasing[0][-1] + 1
        raise InvalidInput(f"motion: times must increase, got one that does not at sample {k}")
    return positions, times


def check_settings(motion: Motion) -> None:
    """Raise InvalidInput for settings of a motion that have no meaning."""
    check_choice("differences", motion.differences, get_args(Differences))
    check_flag("cyclic", motion.cyclic)
    check_flag("ends_at_rest", motion.ends_at_rest)
    read_list("tasks", motion.tasks, Task, "a tuple of tasks")
    check_obstacles(motion.obstacles)
    check_link_radius(motion.link_radius)
    if motion.derivatives is not None:
        check_instance("derivatives", motion.derivatives, Derivatives, "Derivatives or None")


def check_obstacles(obstacles: object) -> None:
    """Raise InvalidInput unless these are a list of obstacles."""
    read_list("obstacles", obstacles, Obstacle, "a list of obstacles")


def check_link_radius(radius: object) -> None:
    """Raise InvalidInput unless links can be as thick."""
    number = finite_number("link_radius", radius)
    if number < 0:
        raise InvalidInput(f"link_radius: 0 m or more wanted, got {number:g}")
