"""The steps of a loop: bounds, choice by weights, and failures. Source: Marcos et al. 2012, section 4.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Objectives
from paretoik.closed_loop.control_step import (
    OPTIONS,
    StepState,
    describe_nearest_obstacle,
    excess_clearance,
    reach_by_joint,
)
from paretoik.closed_loop.step_evolution import Generations, Population
from paretoik.nlp.convex_programs import furthest
from paretoik.task.limits import Bounds
from paretoik.task.motion_task import MotionTask


@dataclass(frozen=True, kw_only=True, eq=False)
class StepRecord:
    """A step of a loop to a sample: its front, index of the chosen point, and generations, if requested."""

    sample: int
    front: Population
    index: int
    generations: Generations | None = None

    @property
    def q(self) -> Float[np.ndarray, " dof"]:
        """Joint positions after the step."""
        return self.front.q[self.index]


def step_limits(task: MotionTask, longest: float) -> tuple[Float[np.ndarray, "time dof 2"], Bounds]:
    """Return the bounds (time, dof, 2) of joints' moves to each sample, and position limits (1 or time, dof, 2).

    A joint moves by ``longest`` [rad, m] at most, and within its velocity limits.
    """
    steps, boundless = np.diff(task.times, prepend=0.0)[:, None, None], np.full((1, task.arm.dof, 2), [-np.inf, np.inf])
    steps[0] = steps[1]
    moves = task.bounds.get("velocity", boundless) * steps
    return np.clip(moves, -longest, longest), task.bounds.get("position", boundless)


def required_standoff(task: MotionTask, longest: float) -> float:
    """Return the extra distance [m] from obstacles at the end of steps that must be clear all the way, else 0."""
    if not np.isfinite(longest):
        return 0.0
    return OPTIONS.shortest_interval * longest * float(reach_by_joint(task).sum())


def state_before(
    task: MotionTask,
    sample: int,
    history: Float[np.ndarray, "history dof"],
    *,
    home: Float[np.ndarray, " dof"],
    longest: float,
) -> StepState:
    """Return the state before the step to a sample, after the ``history`` of joint positions."""
    moves, positions = step_limits(task, longest)
    slack = positions[sample if len(positions) > 1 else 0] - history[-1][:, None]
    return StepState(
        task=task,
        sample=sample,
        history=history,
        home=home,
        lower=np.maximum(moves[sample, :, 0], slack[:, 0]),
        upper=np.minimum(moves[sample, :, 1], slack[:, 1]),
        swept=bool(np.isfinite(longest)),
        standoff=required_standoff(task, longest),
    )


def nondominated_rows(F: Objectives) -> Int[np.ndarray, " front"]:
    """Return the nondominated rows without NaN, in order of the first objective."""
    from moocore import is_nondominated

    valid = np.flatnonzero(~np.isnan(F).any(axis=1))
    index = valid[is_nondominated(F[valid], keep_weakly=False)] if len(valid) else valid
    rows: Int[np.ndarray, " front"] = index[np.lexsort(F[index].T[::-1])]
    return rows


def choose(F: Objectives, weights: Float[np.ndarray, " n_obj"]) -> int:
    """Return the point with the least weighted sum of objectives, scaled to the front (Eqs. 19 and 20)."""
    ideal, width = F.min(axis=0), np.ptp(F, axis=0)
    z = np.where(width > 0, (F - ideal) / np.where(width > 0, width, 1.0), 0.0)  # Eq. 19
    return int(np.argmin(z @ weights))  # Eq. 20


def explain_no_step(step: StepState) -> str:
    """Return why no admissible step was found, as text."""
    task = step.task
    time = task.times[step.sample]
    reason = f"step {step.sample} ({time:.3g} s): there must be an admissible configuration, got none"
    share, limited = reachable_share(step)
    if share < 1:
        joints = ", ".join(task.arm.joint_names[k] for k in limited)
        return f"{reason}; joints would have to move at least {1 / share:.3g} times as far as allowed: {joints}"
    if not task.obstacles:
        return f"{reason}, though joints may move far enough; a larger population or longest_step may help"
    distance = float(excess_clearance(task, step.previous))
    return f"{reason}; the arm is {distance:.3g} m from {describe_nearest_obstacle(task, step.previous)}"


def reachable_share(step: StepState) -> tuple[float, Int[np.ndarray, " joints"]]:
    """Return the largest share of Δx within joint bounds, by a linear program, and the joints at their bounds.

    Bounds beyond 1000 rad or m are reduced to this. Source of Δx: Eq. 8.
    """
    error, jacobian = step.linearise()
    if not error.any():
        return 1.0, np.zeros(0, dtype=int)
    # maximise s subject to J Δq = s Δx, low ≤ Δq ≤ high
    low, high = np.clip(step.lower, -1e3, 0.0), np.clip(step.upper, 0.0, 1e3)
    share, moved = furthest(jacobian, low, high, error)
    return max(share, np.finfo(float).tiny), np.flatnonzero((moved <= low) | (moved >= high))
