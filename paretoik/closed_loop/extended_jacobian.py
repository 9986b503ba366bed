"""The extended Jacobian's best step without any search by chance: verifier of the closed loop, and its real-time form.

With the task eliminated a step of a planar arm is one- or two-dimensional: both objectives of Marcos et al. 2012 (Eqs.
17 and 18) are looked at over all of it, and the least weighted sum (Eqs. 19 and 20) is taken, each objective scaled to
its range on the exact front.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arm import Arm
from paretoik.task.obstacles import Box, Circle, Obstacle

STILL = 1e-12


def exact_steps(
    arm: Arm,
    targets: Float[np.ndarray, "time 2"],
    start: Float[np.ndarray, " dof"],
    *,
    weight: float,
    obstacles: Sequence[Obstacle] = (),
) -> Float[np.ndarray, "time dof"]:
    """Return the joint positions of the loop that always takes the best step; ``weight`` is that of the displacement.

    Obstacles count at the end of a step. Raises InvalidInput for arms that are not planar, at the origin, with three or
    four joints, and for obstacles other than circles and boxes along the axes; Infeasible where no step is free.
    """
    from paretoik.closed_loop.exact_step import best_step  # here: numba takes its time

    lengths, circles, boxes = link_lengths(arm), *shapes(obstacles)
    q = np.empty((len(targets), arm.dof))
    q[0] = start
    for k in range(1, len(targets)):
        if not best_step(lengths, q[k - 1], q[0], targets[k], float(weight), circles, boxes, q[k]):
            raise Infeasible(f"step {k}: a free configuration wanted, there is none")
    return q


def link_lengths(arm: Arm) -> Float[np.ndarray, " dof"]:
    """Return the lengths of a planar arm's links [m].

    Raises InvalidInput for other arms than planar ones with three or four links, their base at the origin.
    """
    offsets = np.array([place.position for place in (*arm.placements[1:], arm.tool)])
    straight = arm.is_planar and np.abs(offsets[:, 1:]).max() < STILL and np.abs(arm.base.position).max() < STILL
    if not straight or arm.dof not in (3, 4) or np.abs(arm.placements[0].position).max() >= STILL:
        raise InvalidInput(f"exact steps: a planar arm of 3 or 4 links at the origin wanted, got {arm!r}")
    return np.ascontiguousarray(offsets[:, 0])


def shapes(obstacles: Sequence[Obstacle]) -> tuple[np.ndarray, np.ndarray]:
    """Return circles (x, y, radius) and boxes (left, bottom, right, top); raise InvalidInput for other obstacles."""
    circles, boxes = [], []
    for obstacle in obstacles:
        if isinstance(obstacle, Circle):
            circles.append([*obstacle.center, obstacle.radius])
            continue
        if not isinstance(obstacle, Box) or np.abs(obstacle.pose.rotation - np.eye(3)).max() > STILL:
            raise InvalidInput(f"exact steps: circles and boxes along the axes wanted, got {obstacle}")
        center, halves = obstacle.pose.position[:2], obstacle.half_sizes[:2]
        boxes.append([*(center - halves), *(center + halves)])
    return np.array(circles).reshape(-1, 3), np.array(boxes).reshape(-1, 4)
