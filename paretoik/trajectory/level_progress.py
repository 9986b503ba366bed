"""What there is of a plan once a level of samples is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import JointPaths
from paretoik.errors import ParetoikError
from paretoik.stop_flag import Interrupted
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
        return _describe_violation(self.task, self.optima[0], np.searchsorted(task.times, self.task.times))


ObserveLevel: TypeAlias = Callable[[LevelProgress], object]


@contextmanager
def explained_interruption(
    task: MotionTask, rollouts: JointPaths, observe: ObserveLevel | None
) -> Iterator[ObserveLevel]:
    """Let a body search for optima: if a signal ends it, the exception says which limits did not hold yet.

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
        with suppress(ParetoikError):  # a user's constraint may fail there
            stop.reason = seen[-1].describe_violation(task) if seen else _describe_violation(task, rollouts[0])
        raise


def _describe_violation(
    task: MotionTask, q: Float[np.ndarray, "samples dof"], numbers: np.ndarray | None = None
) -> str:
    words = task.describe_violation(task.motion(q), numbers)
    return words and f"no motion within the limits so far; of the least-violating one, {words}"
