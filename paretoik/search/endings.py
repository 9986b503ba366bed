"""Endings of a search, and the progress that endings and observers get after each generation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.front.hypervolume import estimate_hypervolume
from paretoik.inputs import check_size, finite_number, real_array
from paretoik.search.archive import Failures
from paretoik.search.objectives import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Progress:
    """The state of a search after a generation; all objectives are minimised.

    generation: number of completed generations
    evaluations: number of evaluations
    seconds: computing time
    failed: failed evaluations
    population: objectives of the population, inf for failed individuals
    front: objectives of the archive
    ids: ids of the archive
    past: fronts of earlier generations that the endings need, newest last
    """

    generation: int
    evaluations: int
    seconds: float
    failed: Failures
    population: Float[np.ndarray, "individuals n_obj"]
    front: Objectives
    ids: Ids
    past: tuple[Floats, ...] = ()

    @cached_property
    def hypervolume(self) -> float:
        """Hypervolume of the front, normalised by its own ideal and nadir; 0 for an empty front."""
        return normalised_hypervolume(self.front, *ideal_and_range(self.front)) if len(self.front) else 0.0


def ideal_and_range(front: Objectives) -> tuple[Values, Values]:
    """Return ideal and width (n_obj,) of a front. If values are equal, width is their magnitude, or 1 for 0."""
    ideal, width = front.min(axis=0), np.ptp(front, axis=0)
    return ideal, np.where(width > 0, width, np.where(ideal != 0, np.abs(ideal), 1.0))


def normalised_hypervolume(F: Floats, ideal: Floats, width: Floats) -> float:
    """Return the hypervolume of ``F`` (points, n_obj), scaled so that ideal is 0 and ideal + width is 1.

    The reference point is 1.1 in every objective. The result is approximate above four objectives, because exact values
    of a large archive take minutes.
    """
    n_obj = F.shape[1]
    return estimate_hypervolume((F - ideal) / width, np.full(n_obj, 1.1), np.ones(n_obj))


@runtime_checkable
class Ending(Protocol):
    """A frozen dataclass that decides when a search ends."""

    @property
    def memory(self) -> int:
        """Number of past generations whose fronts are needed."""

    def reached(self, progress: Progress) -> str | None:
        """Return why the search ends now, or None."""


@dataclass(frozen=True)
class Generations:
    """Ends after ``limit`` generations."""

    limit: int
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        check_size("generations", self.limit, 1)

    def reached(self, progress: Progress) -> str | None:
        """Return "generations" if the limit is reached."""
        return "generations" if progress.generation >= self.limit else None


@dataclass(frozen=True)
class Evaluations:
    """Ends at the first generation after at least ``limit`` evaluations."""

    limit: int
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        check_size("evaluations", self.limit, 1)

    def reached(self, progress: Progress) -> str | None:
        """Return "evaluations" if the limit is reached."""
        return "evaluations" if progress.evaluations >= self.limit else None


@dataclass(frozen=True)
class TimeLimit:
    """Ends at the first generation after ``seconds`` of computing; compilation does not count."""

    seconds: float
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        if not finite_number("time limit", self.seconds) > 0:
            raise InvalidInput(f"time limit must be more than 0 seconds, got {self.seconds}")

    def reached(self, progress: Progress) -> str | None:
        """Return "time limit" if the time is over."""
        return "time limit" if progress.seconds >= self.seconds else None


@dataclass(frozen=True)
class Stagnation:
    """Ends when the front changed little over the last ``over`` generations.

    The archive's hypervolume grew by less than the share ``gain``, and neither ideal nor nadir moved by more than that
    share of the range. Both fronts are measured with the current ranges. Generations before ``since`` do not count.
    """

    gain: float = 1e-4
    over: int = 20
    since: int = 0

    def __post_init__(self) -> None:
        check_size("stagnation over", self.over, 1)
        if not self.gain > 0:
            raise InvalidInput(f"stagnation gain must be more than 0, got {self.gain}")

    @property
    def memory(self) -> int:
        """Number of past generations whose fronts are needed."""
        return self.over

    def reached(self, progress: Progress) -> str | None:
        """Return "stagnation" if the front changed little."""
        is_early = progress.generation < self.since + self.over or len(progress.past) < self.over
        if is_early or not len(earlier := progress.past[-self.over]):
            return None
        ideal, width = ideal_and_range(progress.front)
        ideal_change = np.abs(ideal - earlier.min(axis=0))
        nadir_change = np.abs(progress.front.max(axis=0) - earlier.max(axis=0))
        if (np.maximum(ideal_change, nadir_change) > self.gain * width).any():
            return None
        gain = progress.hypervolume - normalised_hypervolume(earlier, ideal, width)
        return "stagnation" if gain < self.gain * progress.hypervolume else None


@dataclass(frozen=True)
class Target:
    """Ends when a point of the front is at or below all ``values`` (minimised; inf allows any value)."""

    values: Sequence[float]
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        if np.isnan(real_array("target", self.values)).any():
            raise InvalidInput(f"target must be one number per objective, not NaN, got {tuple(self.values)}")

    def reached(self, progress: Progress) -> str | None:
        """Return "target" if it is reached."""
        n_obj = progress.population.shape[1]
        if len(self.values) != n_obj:
            raise InvalidInput(f"target must have one number per objective ({n_obj}), got {len(self.values)}")
        reached = np.less_equal(progress.front, np.asarray(self.values, dtype=float)).all(axis=1)
        return "target" if reached.any() else None
