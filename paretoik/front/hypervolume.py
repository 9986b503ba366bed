"""Hypervolume and non-domination of objectives, all minimised.

Rows with a NaN or an infinity are ignored: a failed evaluation is no point.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Mask, Objectives, Values
from paretoik.errors import InvalidInput


@dataclass(frozen=True, kw_only=True)
class IndicatorOptions:
    """Options of indicators.

    exact_up_to: largest number of objectives for which hypervolumes are exact. With 1,000 points an exact one takes
        0.5 s in five objectives and more than 20 s in seven, an estimate milliseconds.
    directions: number of directions of an estimate
    rounding: smallest range, as a share of the objective's size; smaller ones count as 0, as solvers are not more exact
    """

    exact_up_to: int = 4
    directions: int = 2048
    rounding: float = 1e-9


OPTIONS = IndicatorOptions()


def hypervolume(F: Objectives, reference: Values | Sequence[float]) -> float:
    """Return the volume that `F` dominates and `reference` bounds, in the product of the objectives' units.

    Rows that are not finite, or not below the reference in every objective, add nothing. Raises InvalidInput unless the
    reference has `n_obj` finite numbers.
    """
    import moocore

    limit = _check_reference(F, reference)
    finite = F[np.isfinite(F).all(axis=1)]
    return float(moocore.hypervolume(finite, limit)) if len(finite) else 0.0


def estimate_hypervolume(F: Objectives, reference: Values, width: Values) -> float:
    """Return the hypervolume: exact up to four objectives, else within about one percent.

    Estimates are deterministic (moocore's "Rphi-FWE+"): directions are spread evenly after division by ``width``
    (n_obj,), the approximate distance of the points from the reference. For the same reference and width an estimate
    never falls if points are added or improve. Raises InvalidInput as ``hypervolume`` does.
    """
    if F.shape[1] <= OPTIONS.exact_up_to:
        return hypervolume(F, reference)
    import moocore

    limit = _check_reference(F, reference) / width
    normal = F[np.isfinite(F).all(axis=1)] / width
    inside = normal[np.less(normal, limit).all(axis=1)]
    if not len(inside):
        return 0.0
    return float(moocore.hv_approx(inside, ref=limit, nsamples=OPTIONS.directions) * np.prod(width))


def ranges_of(values: Objectives, sizes: Values | None = None) -> Values:
    """Return nadir minus ideal of points, without zeros.

    If a range is within rounding of 0, the objective's size replaces it, or 1 if the size is 0. ``sizes`` (n_obj,) are
    by default the largest absolute values.
    """
    width = np.ptp(values, axis=0)
    sizes = np.abs(values).max(axis=0) if sizes is None else sizes
    return np.where(width > OPTIONS.rounding * sizes, width, np.where(sizes > 0, sizes, 1.0))


def non_dominated(F: Objectives, tolerance: float = 0.0) -> Mask:
    """Mark the rows of `F` that no other row dominates; only the first of equal rows.

    With a `tolerance` (a share of each objective's range over the non-dominated rows) a row is also dropped if an
    earlier marked row is within the tolerance in every objective. Raises InvalidInput if the tolerance is negative or
    not finite.
    """
    import moocore

    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise InvalidInput(f"non_dominated: tolerance must be a finite number >= 0, got {tolerance}")
    mask = np.zeros(len(F), dtype=bool)
    finite = np.flatnonzero(np.isfinite(F).all(axis=1))
    if not finite.size:
        return mask
    # With keep_weakly all equal rows stay, so that the first of them can be chosen.
    rows = finite[moocore.is_nondominated(F[finite], keep_weakly=True)]
    if tolerance == 0.0:
        mask[rows[np.unique(F[rows], axis=0, return_index=True)[1]]] = True
        return mask
    near = tolerance * np.ptp(F[rows], axis=0)
    for row in rows:
        mask[row] = not (np.abs(F[mask] - F[row]) <= near).all(axis=1).any()
    return mask


def _check_reference(F: Objectives, reference: Values | Sequence[float]) -> Values:
    limit = np.asarray(reference, dtype=float)
    if limit.shape != (F.shape[1],) or not np.isfinite(limit).all():
        raise InvalidInput(f"hypervolume reference must be {F.shape[1]} finite numbers, got {limit.tolist()}")
    return limit


# The hypervolume of a growing front: its reference point is fixed by the first front, so that it never falls.


@dataclass(frozen=True, kw_only=True)
class HypervolumeOptions:
    """Limits on the time for hypervolumes.

    share: largest share of the elapsed time
    free: time [s] of the last hypervolume up to which the next one is always computed

    With thousands of points a hypervolume takes longer than a generation of the search: 0.28 s compared with 0.2 s for
    18,000 points in four objectives.
    """

    share: float = 0.01
    free: float = 0.001


CURVE_OPTIONS = HypervolumeOptions()


class HypervolumeCurve:
    """Hypervolumes of successive fronts, computed if time allows; objectives are minimised."""

    def __init__(self, options: HypervolumeOptions = CURVE_OPTIONS) -> None:
        self._options = options
        self._corner: Values | None = None
        self._width: Values | None = None  # ranges of the first front and the corner
        self._started, self._spent, self._latest = time.monotonic(), 0.0, 0.0
        self._value, self._number = 0.0, 0

    def corner(self, front: Objectives) -> Values | None:
        """Return the reference point (n_obj,), fixed by the first front that is not empty; None before it."""
        if self._corner is None and len(front):
            worst = front.max(axis=0)
            self._corner = worst + np.maximum(ranges_of(front), 0.1 * np.abs(worst))
        return self._corner

    def measure(self, front: Objectives, number: int, corner: Values | None = None) -> float | None:
        """Return the hypervolume of the front of a generation; None if there is no time for it.

        ``corner`` (n_obj,) is the reference point, the same in every call; by default it follows from the first front.
        """
        corner = self.corner(front) if corner is None else corner
        elapsed = time.monotonic() - self._started
        if self._latest > self._options.free and self._spent > self._options.share * elapsed:
            return None
        started = time.thread_time()
        former, self._number, self._value = self._value, number, 0.0
        if corner is not None:
            self._width = ranges_of(np.vstack([front, corner])) if self._width is None else self._width
            self._value = estimate_hypervolume(front, corner, self._width)
        if former:  # the first one also loads a library
            self._latest = time.thread_time() - started
            self._spent += self._latest
        return self._value

    def summary(self, number: int) -> str:
        """Return the last hypervolume in words, with its generation unless that is ``number``."""
        then = "" if self._number == number else f" of generation {self._number}"
        return f"hypervolume {self._value:.4g}{then}"
