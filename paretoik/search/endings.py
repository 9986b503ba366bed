"""When a search ends, and what it says as the reason.

An ending is a frozen dataclass with ``reached(progress)``, which returns the reason or None, and ``memory``, the number
of past generations whose fronts it wants to see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from paretoik.arrays import Values
from paretoik.errors import InvalidInput, check_size
from paretoik.inputs import finite_number, real_array
from paretoik.search.progress import Progress, ideal_and_range, normalised_hypervolume


@runtime_checkable
class Ending(Protocol):
    """What every ending can do."""

    @property
    def memory(self) -> int:
        """How many past fronts it needs."""

    def reached(self, progress: Progress) -> str | None:
        """Return why the search ends now, or None."""


@dataclass(frozen=True)
class Generations:
    """Ends after ``limit`` generations."""

    limit: int
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        check_size("generations", self.limit, 1)

    def reached(self, progress: Progress) -> str | None:
        """Return "generations" once there were that many."""
        return "generations" if progress.generation >= self.limit else None


@dataclass(frozen=True)
class Evaluations:
    """Ends at the first generation with at least ``limit`` evaluations behind it."""

    limit: int
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        check_size("evaluations", self.limit, 1)

    def reached(self, progress: Progress) -> str | None:
        """Return "evaluations" once there were that many."""
        return "evaluations" if progress.evaluations >= self.limit else None


@dataclass(frozen=True)
class TimeLimit:
    """Ends at the first generation after ``seconds``."""

    seconds: float
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if not finite_number("time limit", self.seconds) > 0:
            raise InvalidInput(f"time limit: more than 0 seconds wanted, got {self.seconds}")

    def reached(self, progress: Progress) -> str | None:
        """Return "time limit" once the time is over."""
        return "time limit" if progress.seconds >= self.seconds else None


@dataclass(frozen=True)
class Stagnation:
    """Ends when over the last ``over`` generations the front hardly changed.

    That is: the archive's relative gain in hypervolume is below ``gain``, and neither ideal nor nadir moved by more
    than that share of the range; both fronts are measured over today's ranges. It looks back at most to ``since``.
    """

    gain: float = 1e-4
    over: int = 20
    since: int = 0

    def __post_init__(self) -> None:
        check_size("stagnation over", self.over, 1)
        if not self.gain > 0:
            raise InvalidInput(f"stagnation gain: more than 0 wanted, got {self.gain}")

    @property
    def memory(self) -> int:
        """The generations it looks back."""
        return self.over

    def reached(self, progress: Progress) -> str | None:
        """Return "stagnation" once nothing moves."""
        if (
            progress.generation < self.since + self.over
            or len(progress.past) < self.over
            or not len(progress.past[-self.over])
        ):
            return None
        earlier = progress.past[-self.over]
        ideal, width = ideal_and_range(progress.front)
        ideal_change = np.abs(ideal - earlier.min(axis=0))
        nadir_change = np.abs(progress.front.max(axis=0) - earlier.max(axis=0))
        if (np.maximum(ideal_change, nadir_change) > self.gain * width).any():
            return None
        gain = progress.hypervolume - normalised_hypervolume(earlier, ideal, width)
        return "stagnation" if gain < self.gain * progress.hypervolume else None


@dataclass(frozen=True)
class Target:
    """Ends once one point of the front is at or below each of ``values`` (minimised; inf where it doesn't matter)."""

    values: Sequence[float]
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if np.isnan(real_array("target", self.values)).any():
            raise InvalidInput(f"target: a number an objective wanted, got {tuple(self.values)}")

    def reached(self, progress: Progress) -> str | None:
        """Return "target" once it is met."""
        values = _one_per_objective("target", self.values, progress)
        return "target" if np.less_equal(progress.front, values).all(axis=1).any() else None


def _one_per_objective(name: str, values: Sequence[float], progress: Progress) -> Values:
    n_obj = progress.population.shape[1]
    if len(values) != n_obj:
        raise InvalidInput(f"{name}: {n_obj} numbers wanted, one an objective, got {len(values)}")
    return np.asarray(values, dtype=float)
