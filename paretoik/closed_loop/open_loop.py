"""OLGA: a genetic algorithm for postures at the start of a path. Source: Marcos et al. 2012, section 4.2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.closed_loop.control_step import rotation_rows
from paretoik.closed_loop.programs import traced_errors
from paretoik.errors import Infeasible
from paretoik.task.motion_task import MotionTask
from paretoik.task.traced_motion import trace_sample


class OpenLoopOptions(NamedTuple):
    """Settings of OLGA; the paper's are in section 5.1."""

    population: int = 1600
    generations: int = 200
    crossover_probability: float = 0.5
    mutation_probability: float = 0.5
    largest_angle: float = 2 * np.pi  # rad, either way, for revolute joints without limits
    largest_extension: float = 1.0  # m, either way, for prismatic joints without limits


OPTIONS = OpenLoopOptions()


class PostureWorkspace(NamedTuple):
    """Arrays of the engine, for parents and children: joint positions (dof, individuals) and values.

    Values (2, individuals) are the violation of the clearance [m] and the task error.
    """

    parents: np.ndarray
    children: np.ndarray
    parent_values: np.ndarray
    child_values: np.ndarray
    order: np.ndarray
    sorted_values: np.ndarray
    spare: np.ndarray
    state: np.ndarray


def search_start(task: MotionTask, *, seed: int = 0, options: OpenLoopOptions = OPTIONS) -> Float[np.ndarray, " dof"]:
    """Return joint positions (dof,) at a path's start, by OLGA; raises Infeasible if none is clear of obstacles."""
    from paretoik.closed_loop.open_loop_kernels import search_posture  # imported here: numba loads slowly

    population = options.population
    workspace = PostureWorkspace(
        parents=np.zeros((task.arm.dof, population)),
        children=np.zeros((task.arm.dof, population)),
        parent_values=np.zeros((2, population)),
        child_values=np.zeros((2, population)),
        order=np.zeros(population, np.int64),
        sorted_values=np.zeros((4, population)),
        spare=np.zeros(population, np.int64),
        state=np.zeros(1, np.uint64),
    )
    lower, upper = (np.ascontiguousarray(bound) for bound in posture_bounds(task, options).T)
    if search_posture(seed, options, lower, upper, trace_posture(task).arrays, workspace) > 0:
        count = options.population * options.generations
        raise Infeasible(f"start must be a posture clear of the obstacles, got none of {count} that is clear")
    q: np.ndarray = workspace.parents[:, workspace.order[0]].copy()
    return q


def posture_bounds(task: MotionTask, options: OpenLoopOptions = OPTIONS) -> Float[np.ndarray, "dof 2"]:
    """Return the range of each joint: its limits, or two turns (2 m if prismatic) without, as in the paper."""
    arm = task.arm
    widest = np.where(arm.periodic, options.largest_angle, options.largest_extension)[:, None] * [-1.0, 1.0]
    return np.where(np.isfinite(arm.position_limits), arm.position_limits, widest)


def trace_posture(task: MotionTask) -> Evaluator:
    """Return the evaluator of clearance violation [m] and task error of joint positions.

    The error is the distance from the first target [m] (Eqs. 18, 21, 22), plus the angle [rad] if a task asks for one.
    """
    motion = trace_sample(task)
    tape, rotations = motion.trace.tape, rotation_rows(task)
    errors = traced_errors(motion, task, task.targets[0].tolist())
    distance, angle = (TracedArray(motion.trace, errors[rows], shared=True) for rows in (~rotations, rotations))
    error = np.sqrt((distance**2).sum(-1)) + np.sqrt((angle**2).sum(-1))  # Eq. 18
    missing = np.maximum(task.min_clearance - motion.clearance, 0.0) if task.obstacles else 0.0
    outputs = [each.entries.item() if isinstance(each, TracedArray) else each for each in (missing, error)]
    return compile_evaluator(tape, [as_entry(tape, output) for output in outputs])
