"""Users' own objectives and constraints in formulations whose program is small and dense."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from paretoik.capability.smooth_functions import constraint_terms, objective_term, smooth_term
from paretoik.capability.term_rows import LanesOf, TermRows
from paretoik.nlp.traced import AssembledRows
from paretoik.robot.arm import Arm
from paretoik.task.evaluation import evaluate_motions, require_values
from paretoik.task.limits import Constraint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import Objective, joint_travel
from paretoik.task.path import Path


def function_task(
    arm: Arm, path: Path, objectives: Sequence[Objective], constraints: Sequence[Constraint]
) -> MotionTask:
    """Return an arm with users' functions of motions that have as many samples as a path, all checked; no limits.

    Raises InvalidInput, naming the function, for what is none.
    """
    checked = motion_task(arm, path, objectives=objectives or [joint_travel], constraints=constraints, redundant=False)
    return replace(checked, arm=arm, objectives=tuple(objectives), bounds={})


def read_times(task: MotionTask, motions: Motion) -> bool:
    """Return whether an objective or constraint of motions changes where some of it takes longer than the rest.

    What a function does not see of motions at their pace, a limit on rates for one, it may see at others. Raises
    EvaluationFailed where functions have no values.
    """
    require_values(task, motions)
    shares = motions.time / motions.duration[:, None]
    for pace in (0.1, 1.0, 10.0):
        time = pace * motions.time
        before, after = (
            np.hstack(evaluate_motions(task, replace(motions, time=each))[:2]) for each in (time, time * (1 + shares))
        )
        if not np.allclose(before, after, rtol=1e-9, atol=0, equal_nan=True):
            return True
    return False


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeProgram:
    """The rows and costs of a formulation with users' functions of a ``task`` among them.

    ``base`` and ``base_costs`` are without them; ``lanes`` says how their motions follow from its unknowns, ``near``
    are some of these motions. They have times of their own where there are ``intervals``, unknowns in units of ``pace``
    [s].
    """

    base: AssembledRows
    base_costs: Float[np.ndarray, "objectives unknowns"]
    task: MotionTask
    near: Motion
    lanes: LanesOf
    intervals: Int[np.ndarray, " intervals"]
    pace: float = 1.0

    @cached_property
    def own(self) -> TermRows:
        """The unknowns and rows of users' functions."""
        task = self.task
        sizes = [float(np.median(np.abs(each(self.near)))) or 1.0 for each in task.objectives]
        terms = [objective_term(each, size) for each, size in zip(task.objectives, sizes, strict=True)]
        terms += [term for each in task.constraints for term in constraint_terms(each)]
        own_times = len(self.intervals) > 0
        return TermRows(
            terms=tuple(smooth_term(term, task, self.near, own_times=own_times) for term in terms),
            samples=len(task.times),
            first=self.base.unknowns,
            intervals=self.intervals,
            pace=self.pace,
        )

    @cached_property
    def rows(self) -> AssembledRows:
        """All rows."""
        return AssembledRows(unknowns=self.own.unknowns, parts=(*self.base.parts, *self.own.parts(self.lanes)))

    @cached_property
    def costs(self) -> Float[np.ndarray, "n_obj unknowns"]:
        """The gradients of all objectives, minimised."""
        extra = self.own.unknowns - self.base.unknowns
        return np.concatenate([np.pad(self.base_costs, ((0, 0), (0, extra))), self.own.costs])
