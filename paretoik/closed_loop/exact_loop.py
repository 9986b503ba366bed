"""The loop that always takes the exactly best step: the oracle of the closed loop, and its real-time form.

With the task eliminated a step of a planar arm is one- or two-dimensional. Of all steps the one with the least weighted
sum of Marcos et al. 2012 (Eqs. 17 to 20) is taken, each objective scaled to its range on the exact front.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.closed_loop.control_step import reach_by_joint
from paretoik.closed_loop.obstacle_tables import tabulate, tabulate_balls
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arm import Arm
from paretoik.task.motion_task import MotionTask


class ExactStepOptions(NamedTuple):
    """The grid over the steps of an arm, and its minimisers; radii in rad."""

    nearest_radius: float = 1e-7  # the first of the grid; radii grow by a factor up to fine_radius
    fine_radius: float = 0.1
    farthest_radius: float = 8.0  # radii grow evenly from fine_radius to this
    fine_radii: int = 40  # with one redundant degree
    coarse_radii: int = 80
    fine_radii_4r: int = 24  # with two
    coarse_radii_4r: int = 40
    angles: int = 24
    cells: int = 3  # of the grid that are minimised further, with one redundant degree
    cells_4r: int = 6  # with two
    golden_iterations: int = 36
    simplex_iterations: int = 150
    simplex_tolerance: float = 1e-9  # of the radius: diameter of a simplex that has converged
    newton_iterations: int = 12
    error_tolerance: float = 1e-13  # m: the tool is at its target


OPTIONS = ExactStepOptions()


def exact_steps(
    task: MotionTask, start: Float[np.ndarray, " dof"], *, weight: float, options: ExactStepOptions = OPTIONS
) -> Float[np.ndarray, "time dof"]:
    """Return the joint positions of the loop that always takes the best step; ``weight`` is that of the displacement.

    Obstacles count at the end of a step. Raises InvalidInput for arms that are not planar, at the origin, with three or
    four joints, and for tasks that are not positions in the plane; Infeasible where no step is clear of the obstacles.
    """
    from paretoik.closed_loop.exact_step import best_steps  # here: numba takes its time
    from paretoik.closed_loop.null_space_steps import PlanarSteps

    lengths = link_lengths(task.arm)
    if task.rows != 2 or task.targets.shape[1] != 2:
        raise InvalidInput(f"exact steps: a path of positions in the plane wanted, got {task.rows} rows")
    n = len(lengths)
    cells = 1 + max(
        2 * (options.fine_radii + options.coarse_radii + 1),
        options.angles * (options.fine_radii_4r + options.coarse_radii_4r + 1),
    )
    steps = PlanarSteps(
        lengths=lengths,
        base=np.zeros(n),
        null_space=np.zeros((n, n - 2)),
        center=np.zeros(n - 2),
        target=np.zeros(2),
        obstacles=tabulate(task.obstacles),
        bounding=tabulate_balls(task.obstacles),
        required=task.min_clearance + task.link_radius,
        reach=reach_by_joint(task),
        reference=np.zeros(n),
        margin=np.zeros(1),
        nodes=np.zeros((3 * (n + 1), cells)),
        cells=np.zeros(cells, np.int64),
        distances=np.zeros(cells),
    )
    q = np.empty((len(task.targets), n))
    q[0] = start
    reached = best_steps(np.ascontiguousarray(task.targets), float(weight), options, steps, q)
    if reached < len(q):
        raise Infeasible(f"step {reached}: a free configuration wanted, there is none")
    return q


def link_lengths(arm: Arm, *, tolerance: float = 1e-12) -> Float[np.ndarray, " dof"]:
    """Return the lengths of a planar arm's links [m]; offsets below the tolerance count as 0.

    Raises InvalidInput for other arms than planar ones with three or four links, their base at the origin.
    """
    offsets = np.array([place.position for place in (*arm.placements[1:], arm.tool)])
    straight = arm.is_planar and np.abs(offsets[:, 1:]).max() < tolerance
    at_origin = max(np.abs(place.position).max() for place in (arm.base, arm.placements[0])) < tolerance
    if not straight or not at_origin or arm.dof not in (3, 4):
        raise InvalidInput(f"exact steps: a planar arm of 3 or 4 links at the origin wanted, got {arm!r}")
    return np.ascontiguousarray(offsets[:, 0])
