"""Where pairs of objectives are drawn: one view that holds a scatter of each, ticks at its outer edges alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.drawn_axes import TEXT, Canvas, axis_ranges, window
from paretoik.review.drawing_options import DRAWING, VIEWS
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorder import Population

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Panels:
    """The panels of objectives with ``labels``: for each pair, first across and second upwards, its cell in a grid."""

    labels: tuple[str, ...]

    @property
    def pairs(self) -> list[Pair]:
        """All pairs up to five objectives, neighbours beyond; none of one."""
        n_obj = len(self.labels)
        return list(combinations(range(n_obj), 2) if n_obj <= DRAWING.matrix else pairwise(range(n_obj)))

    def canvases(self, shown: Objectives) -> list[Canvas]:
        """Return a canvas a pair whose windows hold `shown`, none where it has no finite point."""
        shown = shown[np.isfinite(shown).all(axis=1)]
        if len(shown) == 0 or not self.pairs:
            return []
        corners = [window(shown[:, list(pair)]) for pair in self.pairs]
        return [self._canvas(number, low, high) for number, (low, high) in enumerate(corners)]

    def bounds(self) -> rrb.VisualBounds2D:
        """Return the bounds of the view that holds all panels."""
        canvases = [self._canvas(number, np.zeros(2), np.ones(2)) for number in range(len(self.pairs))]
        right = max(canvas.origin[0] + canvas.width for canvas in canvases) + TEXT.right
        bottom = max(canvas.origin[1] + canvas.height for canvas in canvases) + TEXT.bottom + self._stagger
        return rrb.VisualBounds2D(x_range=[-TEXT.left, right], y_range=[-TEXT.top, bottom])

    def view(self, origin: str, contents: Sequence[str], name: str) -> rrb.View:
        """Return the view of all panels."""
        return rrb.Spatial2DView(
            origin=origin, contents=contents, name=name, visual_bounds=self.bounds(), background=SCREEN.background
        )

    def _canvas(self, number: int, low: Values, high: Values) -> Canvas:
        first, second = self.pairs[number]
        matrix = len(self.labels) <= DRAWING.matrix
        count = len(self.labels) - 1
        columns = count if matrix else int(np.ceil(np.sqrt(count)))
        rows = count if matrix else int(np.ceil(count / columns))
        column, row = (first, second - 1) if matrix else (number % columns, number // columns)
        across, below = (12.0, 2.0 * TEXT.line) if matrix else (TEXT.left + 10.0, TEXT.top + TEXT.bottom)
        width = (VIEWS.panels[0] - TEXT.left - TEXT.right - (columns - 1) * across) / columns
        height = (VIEWS.panels[1] - TEXT.top - TEXT.bottom - self._stagger - (rows - 1) * below) / rows
        down = self._stagger * (column % 2) if matrix else 0.0
        return Canvas(
            low=low,
            high=high,
            labels=(self.labels[first], self.labels[second]),
            width=width,
            height=height,
            origin=np.array([column * (width + across), row * (height + below)]),
            ticked=(row == rows - 1, column == 0) if matrix else (True, True),
            label_drop=down,
            overhang=0.45 * across if columns > 1 else TEXT.right,
            right_edge=VIEWS.panels[0] - TEXT.left,
            side_room=(columns - 1 - column) * (width + across) if matrix and column == row else 0.0,
        )

    @property
    def _stagger(self) -> float:
        """How far every second label below is moved down, where neighbours would overlap."""
        count = len(self.labels) - 1
        if not 1 < count < DRAWING.matrix:
            return 0.0
        room = VIEWS.panels[0] / count
        return TEXT.line if TEXT.character * max(map(len, self.labels)) > room - 10.0 else 0.0


def outside_panels(pairs: Sequence[Pair], canvases: Sequence[Canvas], points: Objectives) -> int:
    """Return how many points (points, n_obj) at least one of the panels does not show; none where there are none."""
    seen = [canvas.shows(points[:, list(pair)]) for pair, canvas in zip(pairs, canvases, strict=False)]
    return int((~np.all(seen, axis=0)).sum()) if seen else 0


def normalised(F: Objectives, reference: Population) -> Objectives:
    """Return points as shares of the ranges of a front.

    Where a front has but one value this is in the middle, as all its points are best, and others are infinitely far.
    """
    low, width = reference.min(axis=0), np.ptp(reference, axis=0)
    without_range = np.where(low == F, 0.5, np.copysign(np.inf, F - low))
    normalised: Objectives = np.where(width > 0, (F - low) / np.where(width > 0, width, 1.0), without_range)
    return normalised


def replay_window(fronts: Sequence[Float[np.ndarray, "_ n_obj"]]) -> Objectives:
    """Return corners (2, n_obj) around the last of `fronts` and, as far as they are near, those before it.

    An early front may lie far off; the window reaches at most one and a half of the final range beyond the final one.
    """
    everything, front = np.concatenate(fronts), fronts[-1]
    low, high = front.min(axis=0), front.max(axis=0)
    reach = 1.5 * axis_ranges(low, high)
    return np.stack([np.maximum(everything.min(axis=0), low - reach), np.minimum(everything.max(axis=0), high + reach)])
