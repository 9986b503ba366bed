"""The whole Pareto front of joint motions for a redundant arm.

Names are loaded when they are first used, so that ``import paretoik`` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

__version__ = "0.1.0"

_HOMES = {
    "robot.arm": ("Arm",),
    "robot.pose": ("Pose",),
    "robot.library": ("tringali_3r", "marcos_nr", "wan_7r"),
    "robot.urdf": ("check_robot",),
    "task.path": ("Path", "circle", "line", "poses", "waypoints"),
    "task.task": ("Task",),
    "task.motion": ("Motion",),
    "task.limits": ("Limits", "constraint"),
    "task.obstacles": ("Box", "Capsule", "Circle", "Sphere"),
    "task.objectives": (
        "jerk",
        "joint_drift",
        "joint_limit_distance",
        "joint_travel",
        "kinetic_energy",
        "manipulability",
        "mechanical_energy",
        "objective",
        "obstacle_clearance",
        "peak_torque",
        "peak_velocity",
        "torque_norm",
    ),
    "formulations.tracking": ("Tracking",),
    "search.ask_tell": ("Search",),
    "search.maximin": ("MaxiMin",),
    "search.nsga2": ("MaxiMinNSGA2",),
    "front.front": ("Choice", "Front"),
    "front.preferences": ("Weights",),
    "solving": ("load_front", "solve"),
    "errors": (
        "EvaluationFailed",
        "Infeasible",
        "InvalidInput",
        "InvalidRobot",
        "InvalidRun",
        "OutOfReach",
        "ParetoikError",
    ),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
__all__ = ["__version__", *_HOME]

if TYPE_CHECKING:
    from paretoik.errors import (
        EvaluationFailed,
        Infeasible,
        InvalidInput,
        InvalidRobot,
        InvalidRun,
        OutOfReach,
        ParetoikError,
    )
    from paretoik.formulations.tracking import Tracking
    from paretoik.front.front import Choice, Front
    from paretoik.front.preferences import Weights
    from paretoik.robot.arm import Arm
    from paretoik.robot.library import marcos_nr, tringali_3r, wan_7r
    from paretoik.robot.pose import Pose
    from paretoik.robot.urdf import check_robot
    from paretoik.search.ask_tell import Search
    from paretoik.search.maximin import MaxiMin
    from paretoik.search.nsga2 import MaxiMinNSGA2
    from paretoik.solving import load_front, solve
    from paretoik.task.limits import Limits, constraint
    from paretoik.task.motion import Motion
    from paretoik.task.objectives import (
        jerk,
        joint_drift,
        joint_limit_distance,
        joint_travel,
        kinetic_energy,
        manipulability,
        mechanical_energy,
        objective,
        obstacle_clearance,
        peak_torque,
        peak_velocity,
        torque_norm,
    )
    from paretoik.task.obstacles import Box, Capsule, Circle, Sphere
    from paretoik.task.path import Path, circle, line, poses, waypoints
    from paretoik.task.task import Task


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"paretoik has no {name!r}; it has {', '.join(sorted(_HOME))}")
    return getattr(importlib.import_module(f"paretoik.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
