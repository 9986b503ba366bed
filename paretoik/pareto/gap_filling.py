"""How points spread over a front: which are part of it, how far apart they are, and where one more goes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

POINT_TOLERANCE = 1e-7  # of the ranges: points nearer than this are one, and a gain of less is none


def front_rows(shares: Float[np.ndarray, "points n_obj"]) -> Int[np.ndarray, " rows"]:
    """Return which points, as shares of the ranges, no other dominates or repeats, in the order of the first share.

    Points are taken in the order of their sums: what dominates another has the smaller one. One with a NaN is left out.
    """
    rows = list[int]()
    for i in np.argsort(shares.sum(axis=1), kind="stable").tolist():
        if np.isfinite(shares[i]).all() and not (shares[rows] <= shares[i] + POINT_TOLERANCE).all(axis=1).any():
            rows.append(i)
    front = np.array(rows, dtype=int)
    return front[np.argsort(shares[front, 0], kind="stable")]


def spread_rows(shares: Float[np.ndarray, "points n_obj"], count: int) -> Int[np.ndarray, " rows"]:
    """Return the rows of the best of every objective, however many, then always of the farthest, up to ``count``."""
    rows = list(dict.fromkeys(shares.argmin(axis=0).tolist()))
    while len(rows) < min(count, len(shares)):
        gaps = np.linalg.norm(shares[:, None] - shares[None, rows], axis=2).min(axis=1)
        rows.append(int(gaps.argmax()))
    return np.array(sorted(rows), dtype=int)


def fill_gaps(
    front: Callable[[], Float[np.ndarray, "points n_obj"]],
    add: Callable[[int, Float[np.ndarray, " n_obj"]], bool],
    points: int,
    look_ahead: Callable[[list[tuple[int, Float[np.ndarray, " n_obj"]]]], object] | None = None,
) -> None:
    """Add points where neighbours on the front are farthest apart, until it has so many or no gap yields one.

    ``add`` minimises an objective below upper bounds (inf for its own), and says whether that was a new point. Across a
    jump of the front it would give points at either edge without end: a gap that stays as wide is closed.
    ``look_ahead`` is shown what ``add`` is called with first for every gap, the widest first, as far as is known.
    """
    closed: set[tuple[float, ...]] = set()
    while True:
        values = front()
        if len(values) >= points:
            return
        wide = [pair for pair in _gaps(values) if (*values[pair[0]], *values[pair[1]]) not in closed]
        if not wide:
            return
        if look_ahead is not None:
            look_ahead([_levels(values[list(pair)])[0] for pair in wide])
        ends = values[list(wide[0])]
        for main, upper in _levels(ends):
            if add(main, upper) and not _wide_gaps(front(), ends):
                break
        else:
            closed.update({tuple(ends.ravel().tolist()), *_wide_gaps(front(), ends)})


def _levels(ends: Float[np.ndarray, "2 n_obj"]) -> list[tuple[int, Float[np.ndarray, " n_obj"]]]:
    """Return objectives with the upper bounds of the others halfway between two points.

    First across the longer side; a front with a jump may have a point for one ε and none for the other.
    """
    mains, middle = np.argsort(np.abs(ends[0] - ends[1]), kind="stable"), ends.mean(axis=0)
    return [(int(main), np.where(np.arange(len(middle)) == main, np.inf, middle)) for main in mains]


def _wide_gaps(values: np.ndarray, ends: np.ndarray, *, share: float = 0.95) -> list[tuple[float, ...]]:
    """Return the gaps between two points, as pairs, that are still at least ``share`` as wide as these are apart."""
    size = float(np.linalg.norm(ends[1] - ends[0]))
    off = np.linalg.norm(values[:, None] - ends, axis=2)
    inside = np.sum(off**2, axis=1) <= size**2 * (1 + 1e-9)
    pairs = [(i, j) for i, j in _gaps(values) if inside[i] and inside[j]]
    wide = [pair for pair in pairs if np.linalg.norm(values[pair[0]] - values[pair[1]]) >= share * size]
    return [tuple(np.concatenate([values[i], values[j]]).tolist()) for i, j in wide]


def is_duplicate(value: Float[np.ndarray, " n_obj"], others: Float[np.ndarray, "points n_obj"]) -> bool:
    """Return whether a point is one of others."""
    return bool((np.abs(others - value).max(axis=1) <= 10 * POINT_TOLERANCE).any())


def _gaps(values: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of neighbours, the farthest apart first: no other point lies in the ball between the two."""
    square = np.sum((values[:, None] - values[None]) ** 2, axis=2)
    inside = square[:, None, :] + square[None, :, :] < square[:, :, None]  # (i, j, k): k between i and j
    first, second = np.nonzero(np.triu(~inside.any(axis=2) & (square > (10 * POINT_TOLERANCE) ** 2), 1))
    order = np.argsort(-square[first, second], kind="stable")
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))
