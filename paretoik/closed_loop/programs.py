"""What a step is worth and where the arm is then, written down as programs for the engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.closed_loop.obstacles import round_scene, scene
from paretoik.closed_loop.step import HISTORY, reaches, turning_rows
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_frames
from paretoik.task.motion_task import MotionTask
from paretoik.task.path import Path
from paretoik.task.traced_motion import TracedMotion, trace_sample, trace_sample_function

ORDERS = 4  # positions, velocities, accelerations, jerks


@dataclass(frozen=True, kw_only=True, eq=False)
class StepPrograms:
    """Programs of one arm, task and set of objectives, whatever the step.

    ``objectives`` takes positions, velocities, accelerations and jerks (dof rows each), then the joint positions of
    home, the target and constants; it reads rates of fewer than ``orders`` orders, and has at least two outputs: a
    single objective twice.
    ``nodes`` takes positions, to x, y, z of base, joints and tool; ``obstacles``, ``enclosing`` and ``reach`` are what
    ``Guard`` wants.
    """

    objectives: Evaluator
    orders: int
    nodes: Evaluator
    obstacles: Float[np.ndarray, "obstacles columns"]
    enclosing: Float[np.ndarray, "obstacles columns"]
    reach: Float[np.ndarray, " dof"]
    inputs: int
    constants: Float[np.ndarray, " numbers"]

    @property
    def outputs(self) -> int:
        """Number of rows that ``objectives`` writes."""
        return len(self.objectives.outputs)

    def fixed(self, home: np.ndarray, target: np.ndarray) -> Float[np.ndarray, " rows"]:
        """Return the rows of inputs that a step does not change."""
        return np.concatenate([home, target, self.constants])


def step_programs(task: MotionTask, objectives: Sequence[StepObjective], dt: float) -> StepPrograms:
    """Write down what objectives compute of a step.

    Raises InvalidInput, naming the objective and what it did, where that cannot be written down.
    """
    motion, dof = trace_sample(_window(task, dt)), task.arm.dof
    trace = motion.trace
    home, target = trace.inputs(dof), trace.inputs(task.targets.shape[1])
    error, turns = _errors(motion, task, target), turning_rows(task)
    step = Step(
        motion=motion,  # type: ignore[arg-type]  # expressions pass for arrays
        home=home,  # type: ignore[arg-type]
        position_error=TracedArray(trace, error[~turns], shared=True),  # type: ignore[arg-type]
        rotation_error=TracedArray(trace, error[turns], shared=True),  # type: ignore[arg-type]
        dt=dt,
    )
    outputs = []
    for given in objectives:
        value = trace_sample_function(motion, f"objective {given.name}", _of(given, step))
        if value is None:
            raise InvalidInput(f"objective {given.name}: looks at more than the end of the step")
        outputs.append(as_entry(trace.tape, given.sign * Expression(trace.tape, as_entry(trace.tape, value))))
    found = compile_evaluator(trace.tape, outputs * 2 if len(outputs) == 1 else outputs)
    rates = [int(row) // dof for row in found.inputs if row < ORDERS * dof]
    return StepPrograms(
        objectives=found,
        orders=max(rates, default=0) + 1,
        nodes=_nodes(task),
        obstacles=scene(task.obstacles),
        enclosing=round_scene(task.obstacles),
        reach=reaches(task),
        inputs=len(trace.tape.inputs),
        constants=np.array([values[-1] for values in trace.parameters.values()]),
    )


def _window(task: MotionTask, dt: float) -> MotionTask:
    """Return the task of the few samples that a step is judged by: a mean over time is one over these."""
    times = dt * np.arange(HISTORY + 1)
    given, first = task.tasks[0].path, np.zeros(len(times), dtype=int)
    turns = None if given.quaternions is None else given.quaternions[first]
    path = Path(times, given.positions[first], turns, given.curve)
    return replace(task, tasks=(replace(task.tasks[0], path=path), *task.tasks[1:]))


def _of(given: StepObjective, step: Step) -> Callable[[TracedMotion], Any]:
    return lambda _: given.function(step)


def _errors(motion: TracedMotion, task: MotionTask, target: TracedArray) -> np.ndarray:
    wanted, links, begun = list(target.entries), link_frames(task.arm, list(motion.q.entries)), 0
    found = []
    for each in task.tasks:
        found += each.errors(task.arm, links, wanted[begun : begun + each.target_size])[0]
        begun += each.target_size
    table = np.empty(len(found), dtype=object)
    table[:] = found
    return table


def _nodes(task: MotionTask) -> Evaluator:
    motion = trace_sample(task)
    return compile_evaluator(
        motion.trace.tape, [as_entry(motion.trace.tape, node) for node in motion.links.entries.ravel()]
    )
