"""What there is of a plan once a level of samples is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, ParetoikError
from paretoik.stop_flag import Interrupted
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelProgress:
    """A level of samples that is done: its task, the motions that it started from, and the distinct optima, best first.

    Where none of the level's motions keeps all limits, and it is not ``feasible``, these are the least-violating ones.
    ``ends`` are the motions that the starts led to, ``converged`` says of which a solver says that they are optimal.
    """

    task: MotionTask
    starts: Float[np.ndarray, "starts samples dof"]
    ends: Float[np.ndarray, "starts samples dof"]
    converged: Bool[np.ndarray, " starts"]
    optima: Float[np.ndarray, "optima samples dof"]
    feasible: bool

    @property
    def samples(self) -> int:
        """Number of samples of the level."""
        return len(self.task.times)

    def describe_violation(self, task: MotionTask) -> str:
        """Say which limits the least-violating motion breaks, samples numbered as in a task; "" of a feasible one."""
        if self.feasible or not len(self.optima):
            return ""
        motion = self.task.motion(self.optima[0])
        return _in_words(self.task.describe_violation(motion, np.searchsorted(task.times, self.task.times)))


ObserveLevel: TypeAlias = Callable[[LevelProgress], object]


@contextmanager
def explained_interruption(
    task: MotionTask, rollouts: JointPaths, observe: ObserveLevel | None
) -> Iterator[ObserveLevel]:
    """Let a body search for optima: if a signal ends it, the exception has the motion and limits that did not hold yet.

    The body gets what it has to call after each level, ``observe`` with it. Before any level is done, the first of
    ``rollouts``, which violates limits least, counts.
    """
    seen = list[LevelProgress]()

    def show(level: LevelProgress) -> None:
        seen.append(level)
        if observe is not None:
            observe(level)

    try:
        yield show
    except Interrupted as stop:
        if stop.reason:  # a call of a user's function that was ended
            raise
        with suppress(ParetoikError):  # a user's constraint may fail there
            start = task.motion(rollouts[0])
            stop.reason = seen[-1].describe_violation(task) if seen else _in_words(task.describe_violation(start))
            if stop.reason:
                stop.motion = at_samples(task, seen[-1].task.motion(seen[-1].optima[0])) if seen else start
        raise


def at_samples(task: MotionTask, motion: Motion) -> Motion:
    """Return a motion of a coarser level at the task's own samples, as far as it stays on the path there."""
    if motion.q.shape[-2] == len(task.times):
        return motion
    try:
        return task.motion(motion.at(task.times))
    except Infeasible:
        return motion


def _in_words(violation: str) -> str:
    return violation and f"no motion within the limits so far; of the least-violating one, {violation}"
