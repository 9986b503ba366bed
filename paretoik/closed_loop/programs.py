"""Evaluators of a step's objectives and of the positions of the arm's joints, traced for the engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.closed_loop.control_step import HISTORY, reach_by_joint, rotation_rows
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.errors import InvalidInput
from paretoik.task.motion_task import MotionTask
from paretoik.task.obstacles import Box, Capsule, Circle, Obstacle, Sphere
from paretoik.task.task import path_errors
from paretoik.task.traced_motion import TracedMotion, trace_sample, trace_sample_function

# Obstacles as rows of numbers, for compiled code.


POINT, SEGMENT, BOX = range(3)
KIND, RADIUS, FIRST, SECOND, AXES, COLUMNS = 0, 1, 2, 5, 8, 17
INFINITE_SIZE = 1e30  # m: half the size of an obstacle without end


def tabulate(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return one row per obstacle: kind, radius, two points or a center and half sizes, three axes.

    The last axis of a circle, which is a cylinder in space, is 0.
    """
    rows = np.zeros((len(obstacles), COLUMNS))
    for row, each in zip(rows, obstacles, strict=True):
        row[AXES:] = np.eye(3).ravel()
        if isinstance(each, Box):
            half_sizes = np.append(each.half_sizes, [INFINITE_SIZE] * (3 - len(each.half_sizes)))
            row[KIND], row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = BOX, each.pose.position, half_sizes
            row[AXES:] = each.pose.rotation.T.ravel()
        elif isinstance(each, Capsule):
            row[KIND], row[RADIUS] = SEGMENT, each.radius
            row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = each.start, each.end
        else:
            row[KIND], row[RADIUS], row[FIRST : FIRST + len(each.center)] = POINT, each.radius, each.center
            row[AXES + 8] = 0.0 if isinstance(each, Circle) else 1.0
    return rows


def tabulate_balls(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return the rows of a ball or circle around each obstacle; the obstacle itself if it has none."""
    return tabulate([bounding_ball(obstacle) for obstacle in obstacles])


def bounding_ball(obstacle: Obstacle) -> Obstacle:
    """Return a ball or circle around an obstacle; the obstacle itself if it has none."""
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


ORDERS = 4  # positions, velocities, accelerations, jerks


@dataclass(frozen=True, kw_only=True, eq=False)
class StepPrograms:
    """Evaluators of one arm, task and set of objectives, for every step.

    ``objectives`` takes positions, velocities, accelerations and jerks (dof rows each), then the home joint positions,
    the target and constants. It reads rates of fewer than ``orders`` orders, and has at least two outputs: a single
    objective twice. ``nodes``, ``obstacles``, ``bounding`` and ``reach`` are those of ``StepConstraints``.
    """

    objectives: Evaluator
    orders: int
    nodes: Evaluator
    obstacles: Float[np.ndarray, "obstacles columns"]
    bounding: Float[np.ndarray, "obstacles columns"]
    reach: Float[np.ndarray, " dof"]
    inputs: int
    constants: Float[np.ndarray, " numbers"]


def trace_step(task: MotionTask, objectives: Sequence[StepObjective], dt: float) -> StepPrograms:
    """Return the evaluators of steps of ``dt`` [s].

    Raises InvalidInput, naming the objective and its fault, if an objective cannot be traced.
    """
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
            raise InvalidInput(f"objective {objective.name} must look at a step's end only, got more than that")
        outputs.append(as_entry(trace.tape, objective.sign * Expression(trace.tape, as_entry(trace.tape, value))))
    evaluator = compile_evaluator(trace.tape, outputs * 2 if len(outputs) == 1 else outputs)
    rates = [int(row) // dof for row in evaluator.inputs if row < ORDERS * dof]
    return StepPrograms(
        objectives=evaluator,
        orders=max(rates, default=0) + 1,
        nodes=trace_nodes(task),
        obstacles=tabulate(task.obstacles),
        bounding=tabulate_balls(task.obstacles),
        reach=reach_by_joint(task),
        inputs=len(trace.tape.inputs),
        constants=np.array([values[-1] for values in trace.parameters.values()]),
    )


def traced_errors(motion: TracedMotion, task: MotionTask, target: list[Any]) -> np.ndarray:
    """Return the task errors (rows,) of a traced sample as expressions; ``target`` is as in ``MotionTask.targets``."""
    return np.array(path_errors(task.arm, task.tasks, list(motion.q.entries), target), dtype=object)


def trace_nodes(task: MotionTask) -> Evaluator:
    """Return the evaluator, from joint positions, of x, y and z [m] of the base, joints and tool in order."""
    motion = trace_sample(task)
    return compile_evaluator(motion.trace.tape, [as_entry(motion.trace.tape, x) for x in motion.links.entries.ravel()])
