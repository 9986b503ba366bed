"""Where a label can be put beside its mark or in a frame, and how much it covers there; in any unit of length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

Point = Float[np.ndarray, " 2"]
Places = Float[np.ndarray, "places 2"]
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


def freest_place(middles: Places, half: Point, mark: Point, others: Float[np.ndarray, "marks 2"], gap: float) -> Point:
    """Return the place that covers fewest marks; of such that whose label is nearest to its own `mark`."""
    distances = np.linalg.norm(np.maximum(np.abs(middles - mark) - half, 0.0), axis=1)
    return np.asarray(middles[np.lexsort((distances, count_covered(middles, half, others, gap=gap)))[0]])
