"""The time that certificates take: how long a verb will still take, and what its time limit leaves for them."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.api.time_left import OPTIONS as TIME_LEFT
from paretoik.arrays import Points
from paretoik.execution.time_limit import reserve_time
from paretoik.formulations.protocol import Differentiable, task_of
from paretoik.pareto.certificates import certify


@dataclass(frozen=True, kw_only=True)
class CertificateTime:
    """Certificates have a ``share`` of a time limit, at most ``longest`` [s] a point; so has tightening limits."""

    share: float = 0.2
    longest: float = 2.0


OPTIONS = CertificateTime()


@dataclass(frozen=True, kw_only=True)
class LaterStages:
    """What follows once the points of a front are there: certification, before it tightening of limits if any.

    ``tightening`` takes so long as a share of the time that the points took, 0 where limits are not tightened.
    """

    tightening: float = 0.0

    @classmethod
    def of(cls, problem: Any) -> LaterStages:
        """Return the stages of a problem: limits between samples are tightened of splines."""
        task = task_of(problem)
        tightens = task is not None and task.differences == "spline"
        return cls(tightening=TIME_LEFT.tightening if tightens else 0.0)

    @property
    def text(self) -> str:
        """The stages in words."""
        return "tightening and certification" if self.tightening else "certification"

    def reserve(self, points: int) -> AbstractContextManager[None]:
        """Return a context that ends before the time limit under way, so that the points found in it have them too."""
        count = 2 if self.tightening else 1
        return reserve_time(count * OPTIONS.share, count * points * OPTIONS.longest)


def seconds_per_certificate(formulation: Differentiable, x: Points, ranges: Float[np.ndarray, " n_obj"]) -> float:
    """Return about how long [s] a point's certificate takes: at best of three times, the first of which loads much."""
    if not len(x):
        return 0.0
    program, first, seconds = formulation.program(), x[:1], list[float]()
    for _ in range(3):
        started = time.monotonic()
        certify(program, first, ranges=ranges, signs=np.ones(len(ranges)), violation_between=np.zeros(1))
        seconds.append(time.monotonic() - started)
    return min(seconds)
