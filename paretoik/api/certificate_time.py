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


def reserve_for_certificates(points: int, stages: int = 1) -> AbstractContextManager[None]:
    """Return a context that ends before the time limit under way, so that points found in it are certified, too.

    Two ``stages`` follow where limits are tightened between samples before.
    """
    return reserve_time(stages * OPTIONS.share, stages * points * OPTIONS.longest)


def stages_left(problem: Any) -> int:
    """Return how many stages follow once the points of a front are there: certification, and tightening if any."""
    return 2 if tightening_share(problem) else 1


def stages_after(problem: Any) -> str:
    """Return what follows once the points of a front are there, in words."""
    return "tightening and certification" if tightening_share(problem) else "certification"


def tightening_share(problem: Any) -> float:
    """Return how long limits are tightened between samples, as a share of the time that the points took; 0 for not."""
    task = task_of(problem)
    return TIME_LEFT.tightening if task is not None and task.differences == "spline" else 0.0


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
