"""Polishing motions: a batch of starts to their local optima.

The compiled interior-point method takes programs whose totals are sums of smooth functions of a sample; sequential
quadratic programming takes all others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.nlp.compiled.interior_point import CONVERGED, STUCK, Rules, minimise
from paretoik.nlp.solutions import Solutions
from paretoik.trajectory.sequential import sequential
from paretoik.trajectory.transcription import MotionProgram


def polish(
    program: MotionProgram,
    q: Float[np.ndarray, "motions time dof"],
    factors: Float[np.ndarray, "#motions totals"],
    caps: Float[np.ndarray, "#motions totals"] | None = None,
    rules: Rules | Sequence[Rules] = Rules(),
) -> Solutions:
    """Return the local optima of Σ factors · totals, the totals below ``caps``, that starts on the path lead to.

    Every start goes its own way, whatever else is in the batch; ``rules`` are for all, or one a start. The program's
    own caps hold as well.
    """
    count, q = len(q), program.project(q)
    each = [rules] * count if isinstance(rules, Rules) else list(rules)
    weights = np.broadcast_to(factors, (count, len(program.totals)))
    below = np.broadcast_to(np.inf if caps is None else caps, (count, len(program.totals)))
    below = np.minimum(below, program.upper)
    solver = _compiled if program.is_smooth else _general
    found = solver(program, q, weights, below, each)
    if program.task.ends_at_rest:
        # How the last sample follows is known up to the path's own last step: below that no step makes it better.
        near = (found.status == STUCK) & (found.stationarity <= program.rounding) & (found.violation <= 1e-8)
        found.status[near] = CONVERGED
    if program.task.start is not None:
        found.x[:, 0] = program.task.start  # to the bit: leading back to the path may have rounded it
    return found


def within_limits(
    program: MotionProgram,
    q: Float[np.ndarray, "motions time dof"],
    caps: Float[np.ndarray, " totals"],
    rules: Rules,
) -> Solutions:
    """Return the motions that violate limits and caps least, locally: nothing else is minimised.

    Where their status says that they converged, they hold.
    """
    return _general(
        program,
        q,
        np.zeros((len(q), len(caps))),
        np.tile(np.minimum(caps, program.upper), (len(q), 1)),
        [rules] * len(q),
    )


def _compiled(
    program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray, rules: Sequence[Rules]
) -> Solutions:
    count = len(q)

    def one(i: int) -> tuple[Any, ...]:
        return minimise(program.kernel, np.ascontiguousarray(q[i]), weights[i].copy(), below[i].copy(), rules[i])

    found = list(_pool().map(one, range(count))) if count > 1 else [one(i) for i in range(count)]
    return Solutions(
        x=np.array([one[0] for one in found]).reshape(q.shape),
        status=np.array([one[1] for one in found], dtype=int),
        iterations=np.array([one[2] for one in found], dtype=int),
        objectives=np.array([one[3] for one in found]).reshape(count, len(program.totals)),
        stationarity=np.array([one[5] for one in found], dtype=float),
        violation=np.array([one[6] for one in found], dtype=float),
    )


@cache
def _pool() -> ThreadPoolExecutor:
    """Return threads, one a core, that last as long as the process: compiled code leaves Python's lock alone."""
    return ThreadPoolExecutor(os.cpu_count() or 1)


os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not come along


def _general(
    program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray, rules: Sequence[Rules]
) -> Solutions:
    found = [
        sequential(
            program, motion, factors, caps, radius=rule.radius, iterations=rule.iterations, tolerance=rule.tolerance
        )
        for motion, factors, caps, rule in zip(q, weights, below, rules, strict=True)
    ]
    return Solutions(
        x=np.array([one.q for one in found]).reshape(q.shape),
        status=np.array([one.status for one in found], dtype=int),
        iterations=np.array([one.iterations for one in found], dtype=int),
        objectives=np.array([one.totals for one in found]).reshape(len(q), len(program.totals)),
        stationarity=np.array([one.stationarity for one in found], dtype=float),
        violation=np.array([one.violation for one in found], dtype=float),
    )
