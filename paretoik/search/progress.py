"""What an observer and an ending see after each generation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Values
from paretoik.front.indicators import hypervolume
from paretoik.search.archive import Failures
from paretoik.search.constraints import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Progress:
    """A search after ``generation`` generations, ``evaluations`` and ``seconds``; all objectives minimised.

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


def normalised_hypervolume(
    F: Floats, ideal: Floats, width: Floats, *, reference_point: float = 1.1, exact_up_to: int = 4
) -> float:
    """Hypervolume of ``F`` (points, n_obj) where ideal is 0, ideal + width 1 and the reference 1.1.

    Approximate (deterministically, moocore) above four objectives: of a large archive an exact one takes minutes.
    """
    normal: Floats = (F - ideal) / width
    reference = np.full(F.shape[1], reference_point)
    if F.shape[1] <= exact_up_to:
        return hypervolume(normal, reference)
    from moocore import hv_approx

    inside = normal[np.less(normal, reference).all(axis=1)]
    return float(hv_approx(inside, ref=reference, nsamples=2048)) if len(inside) else 0.0
