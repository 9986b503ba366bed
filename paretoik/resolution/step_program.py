"""The program of one step at a posture: task errors, Jacobian, criteria, distances, and their gradients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies, gradient
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_frames
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.task import path_errors, path_jacobian
from paretoik.task.traced_motion import trace_sample, trace_sample_function


@dataclass(frozen=True, kw_only=True, eq=False)
class StepProgram:
    """The program of a step; its inputs are q, q̇, q̈, jerk (dof rows each) and a row of ``table``.

    The table (time, rows) has the targets of every sample, their travel to the next, and data of criteria that vary
    with time. Accelerations and jerks are not read. The outputs are the task errors, the travel of the target in the
    same coordinates, the Jacobian by rows, then of every criterion its value and its gradient: with respect to
    positions, or to velocities where it reads these alone; then, where they were asked for, of every distance of a
    moving link from an obstacle its value and its gradient with respect to positions.
    """

    program: Evaluator
    table: Float[np.ndarray, "time rows"]
    distances: int


@lru_cache(maxsize=64)  # a search over a method's numbers asks for the same program in every generation
def step_program(task: MotionTask, criteria: tuple[Objective, ...], *, with_distances: bool = False) -> StepProgram:
    """Return the program of one step of a task, with the distances from its obstacles or without.

    Raises InvalidInput, naming the criterion, where it looks at more than one sample's positions and velocities.
    """
    motion = trace_sample(task, duration=1.0)  # means over time are then what they are of one sample
    trace, tape = motion.trace, motion.trace.tape
    travels = np.concatenate([each.displacements(task.times) for each in task.tasks], axis=1)
    targets, travel = (list(trace.inputs(width).entries) for width in (task.targets.shape[1], travels.shape[1]))
    q = list(motion.q.entries)
    components, links = path_errors(task.arm, task.tasks, q, targets), link_frames(task.arm, q)
    for each in task.tasks:
        components += each.displacement_components(task.arm, links, travel[: each.displacement_size])
        travel = travel[each.displacement_size :]
    outputs = [as_entry(tape, value) for value in (*components, *path_jacobian(task.arm, task.tasks, q))]
    inputs = [
        [as_entry(tape, each) for each in part.entries] for part in (motion.q, motion.dq, motion.ddq, motion.jerk)
    ]
    for criterion in criteria:
        label = f"criterion {criterion.name}"
        value = trace_sample_function(motion, label, criterion.function)
        if value is None:
            raise InvalidInput(f"{label}: looks at more than one sample")
        result = as_entry(tape, Expression(tape, as_entry(tape, value)) * 1.0)
        read = {order for order, part in enumerate(inputs) if set(part) & set(dependencies(tape, [result]))}
        if read & {2, 3} or not read:
            raise InvalidInput(f"{label}: wants a function of positions, velocities or both, got one of other things")
        outputs += [result, *gradient(tape, result, inputs[0 if 0 in read else 1])]
    values = [value for each in motion.distances for value in each.entries.ravel()] if with_distances else []
    distances = [as_entry(tape, Expression(tape, as_entry(tape, value)) * 1.0) for value in values]
    moving = [entry for entry in distances if set(dependencies(tape, [entry])) & set(inputs[0])]
    for entry in moving:
        outputs += [entry, *gradient(tape, entry, inputs[0])]
    return StepProgram(
        program=compile_evaluator(tape, outputs),
        distances=len(moving),
        table=np.concatenate([task.targets, travels, *(each[:, None] for each in trace.parameters.values())], axis=1),
    )
