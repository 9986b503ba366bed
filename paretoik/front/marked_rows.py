"""The points of a front that pictures and recordings mark: the best of every objective, and the compromise."""

from __future__ import annotations

import numpy as np

from paretoik.arrays import Ids, Objectives, Values
from paretoik.front.compromise import score_shares


def marked_rows(F: Objectives, ids: Ids) -> list[tuple[int, int | None]]:
    """Return the best of every objective, minimised, as rows and axes, and the compromise, whose axis is None.

    The compromise is that on the points' own ranges; of one objective it is the best point, and all.
    """
    shares = np.array(F.T, order="C")  # a copy that becomes shares in place: a search does this in every generation
    shares -= shares.min(axis=1, keepdims=True)
    width = shares.max(axis=1, keepdims=True)
    shares /= np.where(width > 0, width, 1.0)
    scores = score_shares(shares.T)
    best = enumerate(best_rows(F, ids)) if F.shape[1] > 1 else ()
    return [*((row, axis) for axis, row in best), (_lowest(scores, ids), None)]


def best_rows(F: Objectives, ids: Ids) -> list[int]:
    """Return the row of the best point of every objective, minimised; of equal ones that of the lowest id."""
    return [_lowest(values, ids) for values in F.T]


def _lowest(values: Values, ids: Ids) -> int:
    rows = np.flatnonzero(values == values.min())
    return int(rows[ids[rows].argmin()])
