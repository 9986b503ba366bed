"""The workcell: what of a problem is drawn around its motions, as plain data that can be sent to another process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.formulations.protocol import task_of
from paretoik.front.front import Front
from paretoik.robot.arm import Arm
from paretoik.task.differences import Differences
from paretoik.task.limits import Bounds, Limits
from paretoik.task.motion import Motion
from paretoik.task.obstacles import Obstacle


@dataclass(frozen=True, kw_only=True, eq=False)
class Workcell:
    """An arm and what is around it.

    ``paths`` are those that frames of the arm must follow, each (time, 3) [m]; ``places`` (3,) [m] others that count,
    by name; ``directions`` (directions, 3) unit vectors that begin at the first place. ``bounds`` are limits by kind,
    (1 or time, dof, 2), those that vary at ``times`` [s]; ``link_radius`` [m] is that of every link. ``differences``,
    ``cyclic`` and ``ends_at_rest`` are those of its motions.
    """

    arm: Arm
    paths: tuple[Float[np.ndarray, "time 3"], ...] = ()
    places: Mapping[str, Float[np.ndarray, " 3"]] = field(default_factory=dict)
    directions: Float[np.ndarray, "directions 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    obstacles: tuple[Obstacle, ...] = ()
    link_radius: float = 0.0
    bounds: Mapping[str, Bounds] = field(default_factory=dict)
    times: Times = field(default_factory=lambda: np.zeros(0))
    differences: Differences = "backward"
    cyclic: bool = False
    ends_at_rest: bool = False


def workcell_of(problem: Any) -> Workcell | None:
    """Return the workcell of a formulation, None of a problem without an arm."""
    task = task_of(problem)
    if task is not None:
        return Workcell(
            arm=task.arm,
            paths=tuple(_in_space(each.path.positions) for each in task.tasks),
            obstacles=tuple(task.obstacles),
            link_radius=float(task.link_radius),
            bounds=task.bounds,
            times=task.times,
            differences=task.differences,
            cyclic=task.cyclic,
            ends_at_rest=task.ends_at_rest,
        )
    arm = getattr(problem, "arm", None)
    if not isinstance(arm, Arm):
        return None
    places = {name: np.asarray(getattr(problem, name, ())) for name in ("position", "start", "target")}
    return Workcell(
        arm=arm,
        places={name: _in_space(place) for name, place in places.items() if place.shape in ((2,), (3,))},
        directions=_in_space(np.asarray(getattr(problem, "directions", np.zeros((0, 3))))),
        bounds=Limits(velocity=np.inf, torque=np.inf).bounds(arm, 1),
    )


def workcell_of_front(front: Front) -> Workcell | None:
    """Return the workcell of a front's problem, of one without a problem its arm alone; None without an arm."""
    cell = workcell_of(front.problem)
    if cell is None and isinstance(front.motions, Motion):
        return Workcell(arm=front.motions.arm)
    return cell


def _in_space(points: np.ndarray) -> np.ndarray:
    """Return points (..., 2 or 3) with all three coordinates."""
    padding = [(0, 0)] * (points.ndim - 1) + [(0, 3 - points.shape[-1])]
    return np.pad(np.asarray(points, dtype=float), padding)
