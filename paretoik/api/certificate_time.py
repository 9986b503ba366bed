"""How long a certificate takes, so that a verb can say how long it will still take."""

from __future__ import annotations

import time

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.formulations.protocol import Differentiable
from paretoik.pareto.certificates import certify


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
