"""Names of points in a picture of a front, off all dots and off each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from paretoik.review.label_candidates import count_covered, freest_place, places_beside, places_between


@dataclass(frozen=True, kw_only=True)
class NameSizes:
    """Sizes [points]: of a ``character`` across, of a ``line``, and how far a name is off its mark and off others.

    Where nothing beside its mark is free, a name goes to one of ``grid`` places across and down; one farther off than
    ``leader`` is joined to its mark by a line.
    """

    character: float = 6.0
    line: float = 10.0
    distances: tuple[float, ...] = (5.0, 12.0)
    gap: float = 2.5
    grid: int = 16
    leader: float = 10.0


@dataclass(frozen=True, kw_only=True)
class NamedPoint:
    """A point that has its name beside it: its row, the words, their colour."""

    row: int
    name: str
    colour: str


NAMES = NameSizes()


def name_points(axes: Axes, points: Float[np.ndarray, "points 2"], named: Sequence[NamedPoint]) -> None:
    """Write names beside some of ``points``, which are drawn in axes whose limits are set; one after the other."""
    low, high = (np.array(limits) for limits in zip(axes.get_xlim(), axes.get_ylim(), strict=True))
    size = np.array(axes.bbox.size) * 72.0 / axes.figure.dpi  # before the layout is made: about what it will be
    taken = (points - low) / (high - low) * size
    for point in named:
        mark, half = taken[point.row], np.array([0.5 * NAMES.character * len(point.name), 0.5 * NAMES.line])
        middle = name_place(mark, half, taken, size)
        axes.annotate(
            point.name,
            tuple(points[point.row]),
            tuple(middle - mark),
            textcoords="offset points",
            ha="center",
            va="center",
            color=point.colour,
            weight="bold",
            arrowprops=_leader(mark, middle, half, point.colour),
        )
        taken = np.concatenate([taken, places_between(middle - half, middle + half, 5)])


def name_place(
    mark: Float[np.ndarray, " 2"],
    half: Float[np.ndarray, " 2"],
    taken: Float[np.ndarray, "taken 2"],
    size: Float[np.ndarray, " 2"],
) -> Float[np.ndarray, " 2"]:
    """Return the middle of a name of half a size that covers fewest of what is ``taken`` in axes of a size, in points.

    Beside its mark wherever that is free, else anywhere within the axes.
    """
    beside = places_beside(mark, half, NAMES.distances)
    inside = ((beside - half >= 0.0) & (beside + half <= size)).all(axis=1)
    free = inside & (count_covered(beside, half, taken, gap=NAMES.gap) == 0)
    if free.any():
        return np.asarray(beside[int(free.argmax())])
    return freest_place(places_between(half, size - half, NAMES.grid), half, mark, taken, NAMES.gap)


def _leader(mark: np.ndarray, middle: np.ndarray, half: np.ndarray, colour: str) -> dict[str, object] | None:
    """Return how a name is joined to its mark; None where it stands beside it."""
    if np.linalg.norm(np.maximum(np.abs(middle - mark) - half, 0.0)) <= NAMES.leader:
        return None
    return {"arrowstyle": "-", "color": colour, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 3.0}
