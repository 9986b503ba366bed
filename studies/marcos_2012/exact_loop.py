"""The loop that always takes the exactly best step: the oracle of the closed loop.

With the task eliminated, a step of a planar arm is one- or two-dimensional. The step with the least weighted sum of
Marcos et al. 2012 (Eqs. 17 to 20) is taken, each objective scaled to its range on the exact front.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.closed_loop.control_step import OPTIONS as ENGINE
from paretoik.closed_loop.control_step import StepState, reach_by_joint
from paretoik.closed_loop.loop import required_standoff, step_limits
from paretoik.closed_loop.programs import (
    StepConstraints,
    StepStart,
    allocate,
    bounding_ball,
    required_distance,
    tabulate,
    trace_nodes,
)
from paretoik.errors import Infeasible, InvalidInput
from paretoik.inputs import check_size, finite_array, shown
from paretoik.task.motion_task import MotionTask
from studies.marcos_2012.exact_step import best_steps
from studies.marcos_2012.null_space_steps import PlanarSteps


class ExactStepOptions(NamedTuple):
    """Range of steps, and tolerances at which their cells are no longer halved."""

    farthest: float = 8.0  # rad: largest distance of unbounded steps from the one of least displacement
    tolerance: float = 1e-7  # share of the weighted sum's range: cells that promise less are left out
    end_tolerance: float = 1e-11  # relative, of the least displacement and error; their differences are the ranges
    smallest: float = 1e-9  # rad: undecided cells are halved down to this
    cells: int = 30_000  # largest number of cells per minimisation
    shares: int = 16  # largest number of parts of a step, for the interval nearest to obstacles
    directions: int = 3  # number of directions of the error, in sequence; each bounds a cell near obstacles
    witnesses: int = 6  # largest number of bounds of a link's distance from an obstacle
    newton_iterations: int = 8
    rounding: float = 1e-15  # share of the arm's length: rounding of the tool's error


OPTIONS = ExactStepOptions()


def exact_steps(
    task: MotionTask,
    start: Float[np.ndarray, " dof"],
    *,
    weight: float,
    longest_step: float = np.inf,
    options: ExactStepOptions = OPTIONS,
) -> Float[np.ndarray, "time dof"]:
    """Return the joint positions of the loop that always takes the best step.

    ``weight`` is the weight of the displacement. Steps are admissible as in ``ClosedLoop``: joints move by
    ``longest_step`` at most [rad] and satisfy their limits on position and velocity; steps of any length (np.inf) are
    clear of obstacles at their end only, others all the way. It is proven that no admissible step is better by more
    than the tolerance of the options, if their ``cells`` suffice. They may not suffice near boxes that are tilted out
    of the plane, since these do not cut cells.

    Raises InvalidInput for a weight that is not from 0 to 1, for arms that are not planar, at the origin, with three or
    four joints, and for tasks that are not positions in the plane; Infeasible if no step is admissible or the arm is
    singular.
    """
    lengths = _checked_lengths(task, weight)
    moves, positions = step_limits(task, longest_step)
    shape = moves.shape
    q = np.empty(shape[:2])
    q[0] = finite_array("start", start, shape[1:2])
    reached = best_steps(
        np.ascontiguousarray(task.targets),
        np.ascontiguousarray(np.moveaxis(moves, -1, 0)),
        np.ascontiguousarray(np.moveaxis(np.broadcast_to(positions, shape), -1, 0)),
        q[0].copy(),
        float(weight),
        options,
        planar_steps(task, lengths, bool(np.isfinite(longest_step)), required_standoff(task, longest_step), options),
        q,
    )
    if reached < len(q):
        raise _no_step(reached)
    return q


def exact_step(step: StepState, *, weight: float, options: ExactStepOptions = OPTIONS) -> Float[np.ndarray, " dof"]:
    """Return the joint positions after the best of all admissible steps. Raises as ``exact_steps`` does."""
    task = step.task
    lengths = _checked_lengths(task, weight)
    targets, q = np.tile(step.target, (2, 1)), np.tile(step.previous, (2, 1))
    moves = np.stack([np.tile(step.lower, (2, 1)), np.tile(step.upper, (2, 1))])
    unlimited = np.broadcast_to(np.array([-np.inf, np.inf])[:, None, None], moves.shape).copy()
    steps = planar_steps(task, lengths, step.swept, step.standoff, options)
    if best_steps(targets, moves, unlimited, np.array(step.home), float(weight), options, steps, q) < 2:
        raise _no_step(step.sample)
    return q[1]


def _no_step(sample: int) -> Infeasible:
    return Infeasible(f"step {sample}: there must be an admissible configuration, got none, or the arm is singular")


def planar_steps(
    task: MotionTask, lengths: Float[np.ndarray, " dof"], swept: bool, standoff: float, options: ExactStepOptions
) -> PlanarSteps:
    """Return the arrays of a step, and what all steps share."""
    n = len(lengths)
    cuts = (n * len(task.obstacles) + 1) * options.witnesses
    check_size("cells", options.cells, 2 * n + 4)
    constraints = StepConstraints(
        trace_nodes(task).arrays,
        tabulate(task.obstacles),
        tabulate([bounding_ball(obstacle) for obstacle in task.obstacles]),
        *required_distance(task),
        reach_by_joint(task),
        np.zeros(n),
        np.zeros(n),
        True,
        swept,
        standoff,
    )
    return PlanarSteps(
        lengths=lengths,
        origin=np.zeros(n),
        null_space=np.zeros((n, 2)),
        angles=np.zeros(n),
        slopes=np.zeros((n, 2)),
        target=np.zeros(2),
        bends=np.zeros(2),
        corners=np.zeros((2, 2 * n + 4, 2)),
        start=StepStart(np.zeros(n), np.zeros(n), np.zeros((n, n - 2)), np.zeros((3, n)), 1.0),
        constraints=constraints,
        options=ENGINE,
        workspace=allocate(n, n - 2, 1, 2, n),
        clearance=np.zeros(1),
        cells=np.empty((options.cells, 8)),
        polygons=np.zeros((2, cuts + 3, 5)),
        cuts=np.zeros((cuts, 4)),
        nodes=np.zeros((2, n + 1, 2)),
        turns=np.zeros(n),
    )


def _checked_lengths(task: MotionTask, weight: float) -> Float[np.ndarray, " dof"]:
    """Return the lengths of the links of a task's arm [m]. Raises InvalidInput as ``exact_steps`` does."""
    # The lengths of a planar arm's links [m]; offsets below the tolerance count as 0
    arm = task.arm
    offsets = np.array([place.position for place in (*arm.placements[1:], arm.tool)])
    straight = arm.is_planar and np.abs(offsets[:, 1:]).max() < 1e-12
    at_origin = max(np.abs(place.position).max() for place in (arm.base, arm.placements[0])) < 1e-12
    if not straight or not at_origin or arm.dof not in (3, 4):
        raise InvalidInput(f"exact steps: arm must be planar with 3 or 4 links at the origin, got {shown(arm)}")
    lengths = np.ascontiguousarray(offsets[:, 0])
    if task.rows != 2 or task.targets.shape[1] != 2:
        raise InvalidInput(f"exact steps: path must be positions in the plane, got {task.rows} rows")
    if isinstance(task.link_radius, Sequence):
        raise InvalidInput(f"exact steps: link_radius must be one number, got {len(task.link_radius)} numbers")
    if not 0.0 <= weight <= 1.0:
        raise InvalidInput(f"weight must be between 0 and 1, got {shown(weight)}")
    return lengths
