"""Evaluators of a step's objectives and of the arm's distance to obstacles, traced for the engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.closed_loop.control_step import HISTORY, reach_by_joint, rotation_rows
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_frames
from paretoik.task.distances import distance_components
from paretoik.task.motion_task import MotionTask
from paretoik.task.obstacles import Box, Capsule, Circle, Obstacle, Sphere
from paretoik.task.path import Path
from paretoik.task.traced_motion import TracedMotion, trace_sample, trace_sample_function

ORDERS = 4  # positions, velocities, accelerations, jerks


@dataclass(frozen=True, kw_only=True, eq=False)
class StepPrograms:
    """Evaluators of one arm, task and set of objectives, for every step.

    ``objectives`` takes positions, velocities, accelerations and jerks (dof rows each), then the joint positions of
    home, the target and constants; it reads rates of fewer than ``orders`` orders, and has at least two outputs: a
    single objective twice. ``clearance``, ``bounding`` and ``reach`` are those of ``StepConstraints``.
    """

    objectives: Evaluator
    orders: int
    clearance: Evaluator
    bounding: Evaluator
    reach: Float[np.ndarray, " dof"]
    inputs: int
    constants: Float[np.ndarray, " numbers"]

    @property
    def outputs(self) -> int:
        """Number of rows that ``objectives`` writes."""
        return len(self.objectives.outputs)

    def fixed_inputs(self, home: np.ndarray, target: np.ndarray) -> Float[np.ndarray, " rows"]:
        """Return the rows of inputs that are the same for all candidates of a step."""
        return np.concatenate([home, target, self.constants])


def trace_step(task: MotionTask, objectives: Sequence[StepObjective], dt: float) -> StepPrograms:
    """Return the evaluators of steps of ``dt`` [s].

    Raises InvalidInput, naming the objective and what it did, where an objective cannot be traced.
    """
    motion, dof = trace_sample(_short_task(task, dt)), task.arm.dof
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
        value = trace_sample_function(motion, f"objective {objective.name}", _on(objective, step))
        if value is None:
            raise InvalidInput(f"objective {objective.name}: looks at more than the end of the step")
        outputs.append(as_entry(trace.tape, objective.sign * Expression(trace.tape, as_entry(trace.tape, value))))
    evaluator = compile_evaluator(trace.tape, outputs * 2 if len(outputs) == 1 else outputs)
    rates = [int(row) // dof for row in evaluator.inputs if row < ORDERS * dof]
    around, inside = zip(*map(bounding_balls, task.obstacles), strict=True) if task.obstacles else ((), ())
    return StepPrograms(
        objectives=evaluator,
        orders=max(rates, default=0) + 1,
        clearance=trace_distances(task, [task.obstacles]),
        bounding=trace_distances(task, [around, inside]),
        reach=reach_by_joint(task),
        inputs=len(trace.tape.inputs),
        constants=np.array([values[-1] for values in trace.parameters.values()]),
    )


def traced_errors(motion: TracedMotion, task: MotionTask, target: list[Any]) -> np.ndarray:
    """Return the task errors (rows,) of a traced sample as expressions; ``target`` is as in ``MotionTask.targets``."""
    links, first = link_frames(task.arm, list(motion.q.entries)), 0
    errors = []
    for each in task.tasks:
        errors += each.errors(task.arm, links, target[first : first + each.target_size])[0]
        first += each.target_size
    table = np.empty(len(errors), dtype=object)
    table[:] = errors
    return table


def trace_distances(task: MotionTask, groups: Sequence[Sequence[Obstacle]]) -> Evaluator:
    """Return the evaluator, from joint positions, of the distance [m] of the arm's axes to each group of obstacles.

    It is that of ``task/distances`` as far as it is positive; where the arm meets an obstacle, at most 0; inf for none.
    """
    motion = trace_sample(task)
    nodes = [motion.links[..., axis] for axis in range(3)]
    starts, ends = [node[..., :-1] for node in nodes], [node[..., 1:] for node in nodes]
    distance: Any = distance_components  # of arrays; it takes expressions as well
    outputs = []
    for group in groups:
        distances = [distance(obstacle, starts, ends, depth=False).min(-1) for obstacle in group]
        least = reduce(np.minimum, distances).entries.item() if distances else np.inf
        outputs.append(as_entry(motion.trace.tape, least))
    return compile_evaluator(motion.trace.tape, outputs)


def bounding_balls(obstacle: Obstacle) -> tuple[Obstacle, Obstacle]:
    """Return a ball around an obstacle and one inside it, or circles; the obstacle itself where there is none."""
    if isinstance(obstacle, Capsule):
        center, half_length = (obstacle.start + obstacle.end) / 2, np.linalg.norm(obstacle.end - obstacle.start) / 2
        return Sphere(center, obstacle.radius + float(half_length)), Sphere(center, obstacle.radius)
    if not isinstance(obstacle, Box):
        return obstacle, obstacle
    place, halves = obstacle.pose, obstacle.half_sizes
    around, inside = float(np.linalg.norm(halves)), float(halves.min())
    if len(halves) == 3:
        return Sphere(place.position, around), Sphere(place.position, inside)
    if abs(place.rotation[2, 2]) == 1.0:  # an upright beam
        return Circle(place.position[:2], around), Circle(place.position[:2], inside)
    return obstacle, obstacle


def _short_task(task: MotionTask, dt: float) -> MotionTask:
    """Return the task of the few samples before a step's end: objectives that are means over time take those of it."""
    times = dt * np.arange(HISTORY + 1)
    path, first = task.tasks[0].path, np.zeros(len(times), dtype=int)
    quaternions = None if path.quaternions is None else path.quaternions[first]
    short = Path(times, path.positions[first], quaternions, path.curve)
    return replace(task, tasks=(replace(task.tasks[0], path=short), *task.tasks[1:]))


def _on(objective: StepObjective, step: Step) -> Callable[[TracedMotion], Any]:
    return lambda _: objective.function(step)
