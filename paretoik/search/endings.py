"""When a search ends, and what it says as the reason.

An ending is a frozen dataclass with ``reached(progress)``, which returns the reason or None, and ``memory``, the number
of past generations whose fronts it wants to see.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Event
from typing import Protocol, runtime_checkable

import numpy as np

from paretoik.arrays import Values
from paretoik.errors import InvalidInput, check_size
from paretoik.front.indicators import hypervolume
from paretoik.search.progress import Progress, normalised_hypervolume, spans


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
        if not self.seconds > 0:
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
        then = progress.past[-self.over]
        ideal, width = spans(progress.front)
        ideal_moved = np.abs(ideal - then.min(axis=0))
        nadir_moved = np.abs(progress.front.max(axis=0) - then.max(axis=0))
        if (np.maximum(ideal_moved, nadir_moved) > self.gain * width).any():
            return None
        gained = progress.hypervolume - normalised_hypervolume(then, ideal, width)
        return "stagnation" if gained < self.gain * progress.hypervolume else None


@dataclass(frozen=True)
class Target:
    """Ends once one point of the front is at or below each of ``values`` (minimised; inf where it doesn't matter)."""

    values: Sequence[float]
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if any(math.isnan(value) for value in self.values):
            raise InvalidInput(f"target: a number an objective wanted, got {tuple(self.values)}")

    def reached(self, progress: Progress) -> str | None:
        """Return "target" once it is met."""
        wanted = _one_each("target", self.values, progress)
        return "target" if np.less_equal(progress.front, wanted).all(axis=1).any() else None


@dataclass(frozen=True)
class HypervolumeTarget:
    """Ends once the front's hypervolume below ``reference`` (minimised objectives) is at least ``value``."""

    reference: Sequence[float]
    value: float
    memory: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and all(math.isfinite(number) for number in self.reference)):
            raise InvalidInput(f"hypervolume target: finite numbers wanted, got {self.value}, {tuple(self.reference)}")

    def reached(self, progress: Progress) -> str | None:
        """Return "target" once it is met."""
        reference = _one_each("hypervolume target", self.reference, progress)
        return "target" if len(progress.front) and hypervolume(progress.front, reference) >= self.value else None


@dataclass(frozen=True, eq=False)
class Interrupt:
    """Ends the search after the generation during which ``request`` was called, by a signal handler for instance."""

    reason: str = "interrupted"
    memory: int = field(default=0, init=False, repr=False)
    _requested: Event = field(default_factory=Event, init=False, repr=False)

    def request(self) -> None:
        """Ask the search to end."""
        self._requested.set()

    def reached(self, progress: Progress) -> str | None:
        """Return the reason once the end was requested."""
        return self.reason if self._requested.is_set() else None


def _one_each(name: str, values: Sequence[float], progress: Progress) -> Values:
    n_obj = progress.population.shape[1]
    if len(values) != n_obj:
        raise InvalidInput(f"{name}: {n_obj} numbers wanted, one an objective, got {len(values)}")
    return np.asarray(values, dtype=float)
