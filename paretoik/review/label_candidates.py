"""Where a label can be put beside its mark or in a frame, and how much it covers there; in any unit of length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

Point = Float[np.ndarray, " 2"]
Places = Float[np.ndarray, "places 2"]
Lines = Float[np.ndarray, "lines 2 2"]
NO_LINES = np.zeros((0, 2, 2))
SIDES = np.array([(1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)], dtype=float)


def places_beside(mark: Point, half: Point, distances: tuple[float, ...]) -> Places:
    """Return the middles of a label of half a size on all sides of its `mark`, the nearest first."""
    return np.concatenate([mark + SIDES * (half + distance) for distance in distances])


def places_between(low: Point, high: Point, count: int) -> Places:
    """Return so many places across and along from one corner to the other; one only where there is no way between."""
    across, along = (np.linspace(a, b, count) if a < b else np.array([a]) for a, b in zip(low, high, strict=True))
    return np.stack(np.meshgrid(across, along), axis=-1).reshape(-1, 2)


def count_covered(
    middles: Places, half: Point, others: Float[np.ndarray, "marks 2"], *, gap: float = 0.0
) -> Int[np.ndarray, " places"]:
    """Return how many marks a label of half a size, and a ``gap`` around it, covers at each of its places."""
    across, along = (
        np.abs(others[:, axis] - middles[:, axis, None]) < half[axis] + gap for axis in (0, 1)
    )  # axis by axis: reducing pairs takes NumPy several times as long
    return np.asarray((across & along).sum(axis=1))


def freest_place(
    middles: Places,
    half: Point,
    mark: Point,
    others: Float[np.ndarray, "marks 2"],
    gap: float,
    lines: Lines = NO_LINES,
    *,
    reach: float = 0.0,
) -> Point:
    """Return the place that covers fewest marks, and whose line to its own `mark` crosses fewest ``lines``.

    Of such that whose line touches fewest other marks, all within ``reach`` of it, then the nearest to its mark.
    """
    ends = np.clip(mark, middles - half, middles + half)
    crossed = count_crossed(mark, ends, lines)
    touched = count_touched(mark, ends, others, reach)
    distances = np.linalg.norm(ends - mark, axis=1)
    covered = count_covered(middles, half, others, gap=gap)
    return np.asarray(middles[np.lexsort((distances, touched, crossed + covered))[0]])


def count_crossed(start: Point, ends: Places, lines: Lines) -> Int[np.ndarray, " places"]:
    """Return how many ``lines`` each way from a `start` to one of its ends crosses."""
    tails, tips = lines[:, 0], lines[:, 1]
    sides = _side(start, ends[:, None], tails) * _side(start, ends[:, None], tips)
    ways = _side(tails, tips, start) * _side(tails, tips, ends[:, None])
    return np.asarray(((sides < 0.0) & (ways < 0.0)).sum(axis=1))


def count_touched(
    start: Point, ends: Places, marks: Float[np.ndarray, "marks 2"], reach: float
) -> Int[np.ndarray, " places"]:
    """Return how many marks each line from a `start` to one of its ends comes within ``reach`` of.

    Of a mark that is no farther from the start itself, only a line that leads towards it counts.
    """
    along, away = ends - start, marks - start
    squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    shares = np.clip(away @ along.T / squared, 0.0, 1.0).T
    nearest = np.linalg.norm(away - shares[..., None] * along[:, None], axis=-1)
    return np.asarray((nearest < np.minimum(reach, np.linalg.norm(away, axis=1))).sum(axis=1))


def _side(tail: np.ndarray, tip: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return on which side of a line a point lies, by its sign."""
    along, away = tip - tail, point - tail
    return np.asarray(along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0])
