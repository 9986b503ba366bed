"""What a solver returns: a batch of points with what is known of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import Points

CONVERGED, ITERATION_LIMIT, NO_PROGRESS, SINGULAR, VIOLATED, NOT_FINITE, INTERRUPTED, LOST = range(8)

STATUSES = {
    CONVERGED: "converged",
    ITERATION_LIMIT: "iteration limit reached",
    NO_PROGRESS: "no step makes it better",
    SINGULAR: "at a singularity",
    VIOLATED: "limits cannot all hold",
    NOT_FINITE: "not finite where it starts",
    INTERRUPTED: "interrupted",
    LOST: "the workers that tried it ended",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Solutions:
    """A batch of points that solvers ended at.

    ``objectives`` are F there, ``stationarity`` the RMS length of the Lagrangian's gradient, ``violation`` the worst of
    all constraints as a share of its range, ``status`` a key of STATUSES. ``bound_multipliers`` are those of the upper
    bounds that were asked for: 0 where there was none, NaN where they are unknown.
    """

    x: Points
    objectives: Float[np.ndarray, "points objectives"]
    bound_multipliers: Float[np.ndarray, "points bounds"]
    stationarity: Float[np.ndarray, " points"]
    violation: Float[np.ndarray, " points"]
    status: Int[np.ndarray, " points"]
    iterations: Int[np.ndarray, " points"]

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, rows: Any) -> Solutions:
        return Solutions(**{name: values[rows] for name, values in vars(self).items()})

    def replace_rows(self, rows: Bool[np.ndarray, " points"], other: Solutions) -> Solutions:
        """Return the batch with ``rows`` replaced by another's."""
        parts = {name: values.copy() for name, values in vars(self).items()}
        for name, values in parts.items():
            values[rows] = getattr(other, name)
        return Solutions(**parts)

    @property
    def converged(self) -> Bool[np.ndarray, " points"]:
        """Which are stationary and within all constraints."""
        return self.status == CONVERGED


def concatenate(batches: Sequence[Solutions]) -> Solutions:
    """Return batches as one."""
    return Solutions(**{name: np.concatenate([getattr(each, name) for each in batches]) for name in vars(batches[0])})
