"""Parallel coordinates: an axis an objective beside each other, and a line a point across them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Int

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.drawn_axes import (
    TEXT,
    axis_ranges,
    fitting_ticks,
    labels,
    round_ends,
    text_width,
    tick_words,
)
from paretoik.review.drawing_options import DRAWING, VIEWS
from paretoik.review.even_rows import even_rows
from paretoik.review.palette import SCREEN, Colour


@dataclass(frozen=True, kw_only=True, eq=False)
class ParallelAxes:
    """The axes of objectives with ``labels`` between the values ``low`` and ``high`` (n_obj,), drawn at ``entity``."""

    entity: str
    labels: tuple[str, ...]
    low: Values
    high: Values

    @staticmethod
    def around(entity: str, labels: tuple[str, ...], shown: Objectives) -> ParallelAxes:
        """Return axes that hold all of `shown` (points, n_obj), at least one point; inner ones have round ends."""
        low, high = shown.min(axis=0), shown.max(axis=0)
        margin = 0.04 * axis_ranges(low, high)
        low, high = low - margin, high + margin
        for axis in range(1, len(labels) - 1):
            low[axis], high[axis] = round_ends(low[axis], high[axis])
        return ParallelAxes(entity=entity, labels=labels, low=low, high=high)

    def view(self) -> rrb.View:
        """Return the view."""
        y_range = [-TEXT.top - self._above - self._stagger, self._height + self._below]
        bounds = rrb.VisualBounds2D(x_range=[-TEXT.left, VIEWS.chart[0] - TEXT.left], y_range=y_range)
        return rrb.Spatial2DView(
            origin=self.entity, name="parallel coordinates", visual_bounds=bounds, background=SCREEN.background
        )

    def log(self, recording: rr.RecordingStream, *, static: bool) -> None:
        """Draw axes, ticks and labels: numbers on the outer sides alone, as lines run between axes.

        Inner axes have ticks and numbers where they end alone.
        """
        strips, words, places = list[np.ndarray](), list[str](), list[tuple[float, float]]()
        for axis, (x, low, high) in enumerate(zip(self._x, self.low, self.high, strict=True)):
            strips.append(np.array([(x, 0.0), (x, self._height)]))
            outer = axis in (0, len(self.labels) - 1)
            ticks = np.array([low, high])
            if outer:
                ticks = fitting_ticks(low, high, room=self._height, size=lambda _: 0.6 * TEXT.line, largest=5)
            side = -1.0 if axis == 0 else 1.0
            for tick, word in zip(ticks, tick_words(ticks), strict=True):
                y = float(self._upwards(np.array(tick), low, high))
                strips.append(np.array([(x - 4.0, y), (x + 4.0, y)]))
                words.append(word)
                beyond = -0.6 if tick == high else 0.6
                places.append((x + side * (10.0 + 0.5 * text_width(word)), y) if outer else (x, y + beyond * TEXT.line))
            words.append(self.labels[axis])
            last = self._x[-1] + 0.8 * TEXT.left - 0.5 * text_width(words[-1])
            middle = min(max(x, 0.5 * text_width(words[-1]) - 0.85 * TEXT.left), last) if len(self._x) > 1 else x
            places.append((middle, -0.95 * TEXT.line - self._above - self._stagger * (axis % 2)))
        grid = rr.LineStrips2D(strips, colors=SCREEN.frame, radii=rr.Radius.ui_points(0.8), draw_order=3.0)
        recording.log(f"{self.entity}/axes/lines", grid, static=static)
        recording.log(f"{self.entity}/axes/labels", labels(words, np.array(places)), static=static)

    def lines(self, F: Objectives, colour: Colour, radius: float, order: float) -> rr.LineStrips2D:
        """Return a line a point of F (points, n_obj), evenly picked ones of many."""
        finite = F[np.isfinite(F).all(axis=1)]
        inside = finite[((finite >= self.low) & (finite <= self.high)).all(axis=1)]
        heights = self._upwards(inside[drawn_rows(len(inside))], self.low, self.high)
        strips = [np.stack([self._x, each], axis=1) for each in heights]
        return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order)

    def _upwards(self, values: np.ndarray, low: float | Values, high: float | Values) -> np.ndarray:
        return np.asarray((1.0 - (values - low) / (high - low)) * self._height)

    @property
    def _x(self) -> Values:
        return np.linspace(0.0, VIEWS.chart[0] - TEXT.left - 56.0, len(self.labels))

    @property
    def _height(self) -> float:
        return VIEWS.chart[1] - TEXT.top - self._above - self._stagger - self._below

    @property
    def _below(self) -> float:
        """The height of the words at the lower ends of inner axes."""
        return 1.3 * TEXT.line

    @property
    def _above(self) -> float:
        """The height of the words at the upper ends of inner axes."""
        return TEXT.line if len(self.labels) > 2 else 0.0

    @property
    def _stagger(self) -> float:
        """How far every second label is moved up, where neighbours would overlap."""
        room = VIEWS.chart[0] / len(self.labels)
        return TEXT.line if TEXT.character * max(map(len, self.labels)) > room - 10.0 else 0.0


def drawn_rows(count: int) -> Int[np.ndarray, " rows"]:
    """Return the rows of so many points that have a line."""
    return even_rows(count, DRAWING.parallel_lines)
