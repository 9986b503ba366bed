"""Data of the compiled search: obstacles, evaluators of objectives and arm, and workspace."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.closed_loop.control_step import HISTORY, OPTIONS, reach_by_joint, rotation_rows
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.collision.obstacles import Box, Capsule, Circle, HalfSpace, Obstacle, Sphere
from paretoik.errors import InvalidInput
from paretoik.task.motion_task import MotionTask
from paretoik.task.task import path_errors
from paretoik.task.traced_motion import TracedMotion, trace_sample, trace_sample_function

# Obstacles as rows of numbers.

POINT, SEGMENT, BOX, PLANE = range(4)
KIND, RADIUS, FIRST, SECOND, AXES, COLUMNS = 0, 1, 2, 5, 8, 17


def tabulate(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return one row per obstacle: kind, radius, two points or a center and half sizes, and three axes.

    The last axis of a circle, which is a cylinder in space, is 0. The first axis of a half-space is its normal.
    """
    rows = np.zeros((len(obstacles), COLUMNS))
    for row, each in zip(rows, obstacles, strict=True):
        row[AXES:] = np.eye(3).ravel()
        if isinstance(each, Box):
            infinite = [1e30] * (3 - len(each.half_sizes))  # m: half the size along an infinite axis
            half_sizes = np.append(each.half_sizes, infinite)
            row[KIND], row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = BOX, each.pose.position, half_sizes
            row[AXES:] = each.pose.rotation.T.ravel()
        elif isinstance(each, HalfSpace):
            row[KIND], row[FIRST : FIRST + len(each.point)], row[AXES : AXES + 3] = PLANE, each.point, 0.0
            row[AXES : AXES + len(each.normal)] = each.normal
        elif isinstance(each, Capsule):
            row[KIND], row[RADIUS] = SEGMENT, each.radius
            row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = each.start, each.end
        else:
            row[KIND], row[RADIUS], row[FIRST : FIRST + len(each.center)] = POINT, each.radius, each.center
            row[AXES + 8] = 0.0 if isinstance(each, Circle) else 1.0
    return rows


def required_distance(task: MotionTask) -> tuple[float, Float[np.ndarray, " links"]]:
    """Return ``required`` and ``widths`` of ``StepConstraints``."""
    thinnest = min(task.link_radius) if isinstance(task.link_radius, Sequence) else task.link_radius
    widths = np.broadcast_to(task.link_radius, task.arm.dof + 1) - thinnest
    return task.min_clearance + thinnest, widths


def bounding_ball(obstacle: Obstacle) -> Obstacle:
    """Return a ball or circle around an obstacle, or the obstacle itself if it has none."""
    if isinstance(obstacle, Capsule):
        half_length = float(np.linalg.norm(obstacle.end - obstacle.start)) / 2
        return Sphere((obstacle.start + obstacle.end) / 2, obstacle.radius + half_length)
    if not isinstance(obstacle, Box):
        return obstacle
    place, radius = obstacle.pose, float(np.linalg.norm(obstacle.half_sizes))
    if len(obstacle.half_sizes) == 3:
        return Sphere(place.position, radius)
    is_upright = abs(place.rotation[2, 2]) == 1.0
    return Circle(place.position[:2], radius) if is_upright else obstacle


# Evaluators of a step's objectives and of joint positions.

ORDERS = HISTORY + 1  # positions, velocities, accelerations, jerks


@dataclass(frozen=True, kw_only=True, eq=False)
class StepPrograms:
    """Evaluators of one arm, task and set of objectives, for every step.

    The inputs of ``objectives`` are positions, velocities, accelerations and jerks (dof rows each), then the home joint
    positions, the target and ``constants``. If there is one objective, it is output twice. The other fields are as in
    ``StepConstraints``.
    """

    objectives: Evaluator
    orders: int  # number of orders of derivatives that objectives read: 1 for positions only
    inputs: int
    constants: Float[np.ndarray, " numbers"]
    nodes: Evaluator
    obstacles: Float[np.ndarray, "obstacles columns"]
    bounding: Float[np.ndarray, "obstacles columns"]
    reach: Float[np.ndarray, " dof"]


def trace_step(task: MotionTask, objectives: Sequence[StepObjective], dt: float) -> StepPrograms:
    """Return the evaluators of steps of ``dt`` [s]; raises InvalidInput if an objective cannot be traced."""
    motion, dof = trace_sample(task.standing(dt * np.arange(HISTORY + 1))), task.arm.dof
    trace = motion.trace
    home, target = trace.inputs(dof), trace.inputs(task.targets.shape[1])
    error, rotations = traced_errors(motion, task, list(target.entries)), rotation_rows(task)
    step = Step(
        motion=motion,  # type: ignore[arg-type]  # expressions pass for arrays
        home=home,  # type: ignore[arg-type]
        position_error=TracedArray(trace, error[~rotations], shared=True),  # type: ignore[arg-type]
        rotation_error=TracedArray(trace, error[rotations], shared=True),  # type: ignore[arg-type]
        dt=dt,
    )
    outputs = []
    for objective in objectives:

        def evaluate(_: TracedMotion, objective: StepObjective = objective) -> Any:
            return objective.function(step)

        value = trace_sample_function(motion, f"objective {objective.name}", evaluate)
        if value is None:
            raise InvalidInput(f"objective {objective.name} must depend only on a step's end, got one that reads more")
        outputs.append(as_entry(trace.tape, objective.sign * Expression(trace.tape, as_entry(trace.tape, value))))
    evaluator = compile_evaluator(trace.tape, outputs * 2 if len(outputs) == 1 else outputs)
    rates = [int(row) // dof for row in evaluator.inputs if row < ORDERS * dof]
    return StepPrograms(
        objectives=evaluator,
        orders=max(rates, default=0) + 1,
        nodes=trace_nodes(task),
        obstacles=tabulate(task.obstacles),
        bounding=tabulate([bounding_ball(obstacle) for obstacle in task.obstacles]),
        reach=reach_by_joint(task),
        inputs=len(trace.tape.inputs),
        constants=np.array([values[-1] for values in trace.parameters.values()]),
    )


def traced_errors(motion: TracedMotion, task: MotionTask, target: list[Any]) -> np.ndarray:
    """Return the task errors (rows,) of a traced sample, for a target as in ``MotionTask.targets``."""
    return np.array(path_errors(task.arm, task.tasks, list(motion.q.entries), target), dtype=object)


def trace_nodes(task: MotionTask) -> Evaluator:
    """Return the evaluator of x, y and z [m] of base, joints and tool, from joint positions."""
    motion = trace_sample(task)
    return compile_evaluator(motion.trace.tape, [as_entry(motion.trace.tape, x) for x in motion.links.entries.ravel()])


# Tuples of arrays and numbers, as compiled code takes them; each thread needs a workspace of its own.


class StepStart(NamedTuple):
    """Start of a step."""

    previous: np.ndarray  # joint positions (dof,)
    particular: np.ndarray  # the shortest step (dof,) that makes Δx
    null_space: np.ndarray  # null space of the Jacobian (dof, redundancy)
    rates: np.ndarray  # velocity, acceleration and jerk (3, dof) before the step
    dt: float  # s: time between steps


class ObjectiveProgram(NamedTuple):
    """The evaluator of the objectives, and the number of orders of derivatives that they read, 1 for positions only."""

    arrays: Any
    orders: int


class StepConstraints(NamedTuple):
    """Obstacles, required distance of links, and bounds of joints' moves."""

    nodes: Any  # evaluator of the positions of the arm's joints
    obstacles: np.ndarray  # rows of ``tabulate``
    bounding: np.ndarray  # rows of ``tabulate`` for the balls around obstacles
    required: float  # m: smallest distance of the axes of the thinnest links from obstacles
    widths: np.ndarray  # m: radius (links,) of each link beyond that of the thinnest one
    reach: np.ndarray  # largest move (dof,) of any point of the arm with each joint
    lower: np.ndarray  # bounds (dof,) of each joint's move, if ``bounded``
    upper: np.ndarray
    bounded: bool
    swept: bool  # whether the whole step must be clear, not only its end
    standoff: float  # m: distance at the end of the step beyond the required one


class KeptGenerations(NamedTuple):
    """The first generations of a search: genes (generations, individuals, genes) and objectives.

    Objectives (generations, individuals, n_obj) are minimised, inf if a step failed.
    """

    genes: np.ndarray
    F: np.ndarray


SelectionWorkspace = namedtuple(
    "SelectionWorkspace",
    "points front fitness x y stack places dominated spare rank scaled nearest chosen values begins objectives "
    "distance",
)
Workspace = namedtuple(
    "Workspace",
    "genes F order fitness children redrawn redrawn_positions state inputs outputs linear_systems pending candidates "
    "travel scale configurations nodes distances intervals selection",
)


def allocate(dof: int, redundancy: int, population: int, objectives: int, inputs: int) -> Workspace:
    """Return arrays of a population and its children, to evaluate them and to select the survivors."""
    N, M, r, size, both = population, objectives, redundancy, redundancy * (dof + 1), 2 * population
    evaluated, index = max(N, OPTIONS.interval_batch), np.int64
    selection = SelectionWorkspace(
        points=np.zeros(both, index),
        front=np.zeros(both, index),
        fitness=np.zeros(both),
        x=np.zeros(both),
        y=np.zeros(both),
        stack=np.zeros((both, 2), index),
        places=np.zeros(N, np.uint64),
        dominated=np.zeros(N, np.uint64),
        spare=np.zeros(both, index),
        rank=np.zeros(both, index),
        scaled=np.zeros((M, both)),
        nearest=np.zeros(both),
        chosen=np.zeros(both, index),
        values=np.zeros((4, both)),
        begins=np.zeros(both + 2, index),
        objectives=np.zeros((M, both)),
        distance=np.zeros(both),
    )
    return Workspace(
        genes=np.zeros((N, size)),  # one row per individual
        F=np.zeros((M, both)),  # objectives of the parents in their order, then those of the children
        order=np.zeros(N, index),  # rows of the parents in ``genes``, in their order
        fitness=np.zeros(N),  # fitness of the parents in a tournament, in their order
        children=np.zeros((size, N)),  # genes of the children, in columns
        redrawn=np.zeros((size, N)),  # genes drawn in place of inadmissible children
        redrawn_positions=np.zeros((dof, N)),  # joint positions of these
        state=np.zeros(1, np.uint64),
        inputs=np.zeros((inputs, N)),  # joint positions and rates of the children, in columns
        outputs=np.zeros((M, N)),
        linear_systems=np.zeros((r * r + r, N)),
        pending=np.zeros(N, index),
        candidates=np.zeros(N, index),
        travel=np.zeros(N),
        scale=np.zeros(N),
        configurations=np.zeros((dof, evaluated)),
        nodes=np.zeros((3 * (dof + 2), evaluated)),
        distances=np.zeros(evaluated),
        intervals=np.zeros((5, N + OPTIONS.interval_batch * OPTIONS.interval_depth)),
        selection=selection,
    )
