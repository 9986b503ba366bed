"""Polishing motions: the compiled interior-point method for a whole batch of starts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.refinement.compiled.interior_point import CAPPED, CONVERGED, SINGULAR, STUCK, VIOLATED, Rules, minimise
from paretoik.refinement.program import MotionProgram

REASONS = {
    CONVERGED: "converged",
    CAPPED: "iteration limit reached",
    STUCK: "no step makes it better",
    SINGULAR: "at a singularity",
    VIOLATED: "limits cannot all hold",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Polished:
    """What became of a batch of starts.

    ``q`` are motions on the path, ``sums`` the program's sums there, ``multipliers`` those of the limits and then of
    the finite caps, ``stationarity`` the length of the Lagrangian's gradient (RMS over time), ``violation`` the worst
    of limits and caps, ``status`` a key of REASONS.
    """

    q: Float[np.ndarray, "motions time dof"]
    sums: Float[np.ndarray, "motions sums"]
    multipliers: Float[np.ndarray, "motions limits"]
    stationarity: Float[np.ndarray, " motions"]
    violation: Float[np.ndarray, " motions"]
    status: Int[np.ndarray, " motions"]
    iterations: Int[np.ndarray, " motions"]

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: Any) -> Polished:
        return Polished(**{name: values[rows] for name, values in vars(self).items()})

    def merged(self, rows: Bool[np.ndarray, " motions"], other: Polished) -> Polished:
        """Return the batch with ``rows`` replaced by another's."""
        parts = {name: values.copy() for name, values in vars(self).items()}
        for name, values in parts.items():
            values[rows] = getattr(other, name)
        return Polished(**parts)

    @property
    def converged(self) -> Bool[np.ndarray, " motions"]:
        """Which are stationary and within their limits."""
        return self.status == CONVERGED


def polish(
    program: MotionProgram,
    q: Float[np.ndarray, "motions time dof"],
    factors: Float[np.ndarray, "#motions sums"],
    caps: Float[np.ndarray, "#motions sums"] | None = None,
    rules: Rules | Sequence[Rules] = Rules(),  # noqa: B008  a tuple of numbers
) -> Polished:
    """Return the local optima of Σ factors · sums, with the sums below ``caps``, that starts on the path lead to.

    Every start goes its own way, whatever else is in the batch; ``rules`` are for all, or one a start.
    """
    count = len(q)
    each = [rules] * count if isinstance(rules, Rules) else list(rules)
    weights = np.broadcast_to(factors, (count, len(program.sums)))
    below = np.broadcast_to(np.inf if caps is None else caps, (count, len(program.sums)))

    def part(rows: range) -> list[tuple[Any, ...]]:
        compiled = program.compiled
        return [
            minimise(compiled, np.ascontiguousarray(q[i]), weights[i].copy(), below[i].copy(), each[i]) for i in rows
        ]

    workers = max(1, min(count, os.cpu_count() or 1))
    shares = [range(w, count, workers) for w in range(workers)]
    if workers == 1:
        parts = [part(shares[0])]
    else:
        with ThreadPoolExecutor(workers) as pool:
            parts = list(pool.map(part, shares))
    found = [parts[i % workers][i // workers] for i in range(count)]
    most = max((len(one[4]) for one in found), default=0)
    motions = np.array([one[0] for one in found]).reshape(q.shape)
    if program.task.start is not None:
        motions[:, 0] = program.task.start  # to the bit: leading back to the path may have rounded it
    return Polished(
        q=motions,
        status=np.array([one[1] for one in found], dtype=int),
        iterations=np.array([one[2] for one in found], dtype=int),
        sums=np.array([one[3] for one in found]).reshape(count, len(program.sums)),
        multipliers=np.array([np.pad(one[4], (0, most - len(one[4]))) for one in found]).reshape(count, most),
        stationarity=np.array([one[5] for one in found], dtype=float),
        violation=np.array([one[6] for one in found], dtype=float),
    )
