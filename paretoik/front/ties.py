"""Which point comes first where several score alike: the one rule of all preferences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paretoik.arrays import Mask, Values
from paretoik.front.preference_options import OPTIONS

if TYPE_CHECKING:  # a front asks this file for its first point
    from paretoik.front.front import Front


def first_row(front: Front, scores: Values, among: Mask | None = None) -> int:
    """Return the row with the least of ``scores`` (points,), in shares of the ranges; of several the first.

    Scores within rounding of the least are equal. Then comes the point with the lowest sum of shares ΣZ, of equal
    sums (within the same) the one with the better first objective, then the second and so on, then the lowest id.
    ``among`` marks the rows that are looked at, at least one; all if None.
    """
    rows = np.arange(len(front)) if among is None else np.flatnonzero(among)
    for values in (scores, front.shares.sum(axis=1)):
        rows = rows[values[rows] <= values[rows].min() + OPTIONS.rounding]
    order = np.lexsort((front.ids[rows], *front.minimised[rows].T[::-1]))
    return int(rows[order[0]])
