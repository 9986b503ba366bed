"""What there is of a plan once a level of samples is done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float

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
        numbers = np.searchsorted(task.times, self.task.times)
        words = self.task.describe_violation(self.task.motion(self.optima[0]), numbers)
        return words and f"no motion within the limits so far; of the least-violating one, {words}"


ObserveLevel: TypeAlias = Callable[[LevelProgress], object]
