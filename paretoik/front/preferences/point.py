"""A preference for one point, by its id."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.front.front import Choice, Front
from paretoik.front.subset import row_of
from paretoik.tables import html_representation


@dataclass(frozen=True)
class Point:
    """The point with an id, picked by hand: what ``front.select(12)`` means."""

    point: int

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point; raises InvalidInput where the front does not have it."""
        row = row_of(front, self.point, name="select: point")
        return front.choice(row, f"Point {front.ids[row]} of {len(front)} was picked by its id.", preference=self)
