"""When a search ends, and for what reason; the progress that endings and observers see after each generation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.front.indicators import estimate_hypervolume
from paretoik.inputs import check_size, finite_number, real_array
from paretoik.search.archive import Failures
from paretoik.search.objectives import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Progress:
    """A search after ``generation`` generations, ``evaluations`` and ``seconds`` computed; all objectives minimised.

    ``population`` (individuals, n_obj) is what evolves and may hold failed rows; ``front`` (points, n_obj) and ``ids``
    (points,) are the archive's; ``past`` are the fronts of earlier generations, newest last, as far back as
    the endings asked for.
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
        """The front's, normalised by its own ideal and nadir; 0 for an empty front."""
        return normalised_hypervolume(self.front, *ideal_and_range(self.front)) if len(self.front) else 0.0


def ideal_and_range(front: Objectives) -> tuple[Values, Values]:
    """Ideal and width (n_obj,) of a front; an axis without range has its magnitude for a width, or 1."""
    ideal, width = front.min(axis=0), np.ptp(front, axis=0)
    return ideal, np.where(width > 0, width, np.where(ideal != 0, np.abs(ideal), 1.0))


def normalised_hypervolume(F: Floats, ideal: Floats, width: Floats, *, reference_point: float = 1.1) -> float:
    """Hypervolume of ``F`` (points, n_obj) where ideal is 0, ideal + width 1 and the reference 1.1.

    Approximate above four objectives: of a large archive an exact one takes minutes.
    """
    n_obj = F.shape[1]
    return estimate_hypervolume((F - ideal) / width, np.full(n_obj, reference_point), np.ones(n_obj))


@runtime_checkable
class Ending(Protocol):
    """A frozen dataclass that knows when a search ends."""

    @property
    def memory(self) -> int:
        """How many past generations' fronts it wants to see."""

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
        """Return "generations" once there were that many."""
        return "generations" if progress.generation >= self.limit else None


@dataclass(frozen=True)
class Evaluations:
    """Ends at the first generation with at least ``limit`` evaluations behind it."""

    limit: int
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        check_size("evaluations", self.limit, 1)

    def reached(self, progress: Progress) -> str | None:
        """Return "evaluations" once there were that many."""
        return "evaluations" if progress.evaluations >= self.limit else None


@dataclass(frozen=True)
class TimeLimit:
    """Ends at the first generation after ``seconds`` of computing; compiling code is not counted."""

    seconds: float
    memory: ClassVar[int] = 0

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
    """Ends once one point of the front is at or below each of ``values`` (minimised; inf where it doesn't matter)."""

    values: Sequence[float]
    memory: ClassVar[int] = 0

    def __post_init__(self) -> None:
        if np.isnan(real_array("target", self.values)).any():
            raise InvalidInput(f"target: a number an objective wanted, got {tuple(self.values)}")

    def reached(self, progress: Progress) -> str | None:
        """Return "target" once it is met."""
        n_obj = progress.population.shape[1]
        if len(self.values) != n_obj:
            raise InvalidInput(f"target: {n_obj} numbers wanted, one an objective, got {len(self.values)}")
        reached = np.less_equal(progress.front, np.asarray(self.values, dtype=float)).all(axis=1)
        return "target" if reached.any() else None
