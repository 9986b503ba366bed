"""Curves over a search or a motion, drawn by hand: a series view is empty while the other timeline plays.

The curves are there on both timelines; a cursor moves along them on the one that is theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Series, Times
from paretoik.review.drawn_axes import Canvas, window
from paretoik.review.palette import SCREEN, Colour


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Named curves (curves, instants) over instants, drawn at ``entity``; values that are not finite are left out."""

    entity: str
    title: str
    labels: tuple[str, str]
    instants: Times
    curves: Series
    names: Sequence[str]
    colours: Sequence[Colour]
    width: float = 190.0
    height: float = 30.0

    def view(self) -> rrb.View:
        """Return the chart's view."""
        bounds = self._canvas().bounds()
        return rrb.Spatial2DView(
            origin=self.entity, name=self.title, visual_bounds=bounds, background=SCREEN.background
        )

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, curves and names, at all times."""
        canvas = self._canvas()
        canvas.log(recording, self.entity, static=True)
        strips = [canvas.place(self._points(curve)) for curve in self.curves]
        lines = rr.LineStrips2D(strips, colors=list(self.colours), radii=rr.Radius.ui_points(1.2), draw_order=1.0)
        recording.log(f"{self.entity}/curves", lines, static=True)
        if len(self.curves) > 1:
            ends = _spread_labels([strip[-1, 1] for strip in strips], gap=1.7 * canvas.text)
            points = [[canvas.width + 4.0 * canvas.text, end - 1.2 * canvas.text] for end in ends]
            names = rr.Points2D(
                points,
                labels=list(self.names),
                show_labels=True,
                colors=list(self.colours),
                radii=rr.Radius.ui_points(0.0),
            )
            recording.log(f"{self.entity}/names", names, static=True)

    def send_cursor(
        self, recording: rr.RecordingStream, columns: Sequence[rr.TimeColumn], instants: Times | None = None
    ) -> None:
        """Let a line stand at each of `instants` (by default the chart's) in turn, one row of `columns` an instant."""
        canvas = self._canvas()
        stops = self.instants if instants is None else instants
        edges = np.array([[(instant, canvas.low[1]), (instant, canvas.high[1])] for instant in stops])
        style = rr.LineStrips2D.from_fields(colors=SCREEN.text, radii=rr.Radius.ui_points(0.8), draw_order=2.0)
        recording.log(f"{self.entity}/cursor", style, static=True)
        strips = rr.LineStrips2D.columns(strips=list(canvas.place(edges)))
        recording.send_columns(f"{self.entity}/cursor", columns, strips)

    def _points(self, curve: Times) -> np.ndarray:
        points = np.stack([self.instants, curve], axis=-1)
        finite: np.ndarray = points[np.isfinite(points).all(axis=-1)]
        return finite

    def _canvas(self) -> Canvas:
        low, high = window(np.concatenate([self._points(curve) for curve in self.curves]))
        if len(self.instants) > 1:
            low[0], high[0] = self.instants[0], self.instants[-1]
        return Canvas(low=low, high=high, labels=self.labels, width=self.width, height=self.height, text=3.6)


def _spread_labels(places: Sequence[float], *, gap: float) -> list[float]:
    """Return `places` moved until neighbours have at least a distance of `gap`, about the same middle."""
    order = np.argsort(places, kind="stable")
    moved = np.array(places, dtype=float)
    for above, below in pairwise(order):
        moved[below] = max(moved[below], moved[above] + gap)
    return list(moved - (moved - np.array(places)).max() / 2)
