"""Curves over a search or a motion, drawn by hand: a series view is empty while another timeline plays.

The curves are visible on every timeline; a cursor moves along them on their own one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Series, Times, Values
from paretoik.review.drawing.axes import TEXT, Canvas, labels, screen_text, text_width, tick_text, window
from paretoik.review.drawing.layout import nested_tabs
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, Colour


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitLine:
    """A limit over ``instants``: its ``values``, the name of the limited joint ("" for all joints), and its colours.

    If several joints share a limit, its dashes alternate between their ``colours``.
    """

    instants: Times
    values: Times
    name: str
    colours: Sequence[Colour]


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Named curves (curves, instants) at ``entity``, on axes that contain all of ``shown`` and the nearby limits.

    ``curves`` are drawn for all times; those of a chart without them are drawn by ``draw``. ``shown``: all points
    (points, 2) that will ever be drawn, by default the curves; non-finite values are left out. Values that are
    negligible compared with limits and the ``usual`` ones count as 0: axes then contain all limits, and the usual
    values if all limits are 0. With ``dots`` instants have no order, and no lines join them. A curve of one point is
    also a dot.
    """

    entity: str
    title: str
    labels: tuple[str, str]
    names: Sequence[str]
    colours: Sequence[Colour]
    instants: Times = field(default_factory=lambda: np.zeros(0))
    curves: Series = field(default_factory=lambda: np.zeros((0, 0)))
    shown: np.ndarray | None = None
    limits: Sequence[LimitLine] = ()
    usual: float = 0.0
    total: tuple[float, float] = VIEWS.chart
    dots: bool = False

    def view(self) -> rrb.View:
        """Return the chart's view."""
        bounds = self.canvas.bounds(right=self._right)
        name = screen_text(self.title)
        return rrb.Spatial2DView(origin=self.entity, name=name, visual_bounds=bounds, background=SCREEN.background)

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, limits and the curves, for all times."""
        self.canvas.log(recording, self.entity, static=True)
        near = [limit for limit in self.limits if self._is_near(limit)]
        if near:
            dashes = [self._dashes(limit) for limit in near]
            colours = [
                limit.colours[number % len(limit.colours)]
                for limit, strips in zip(near, dashes, strict=True)
                for number in range(len(strips))
            ]
            strips = [strip for each in dashes for strip in each]
            lines = rr.LineStrips2D(strips, colors=colours, radii=rr.Radius.ui_points(0.9), draw_order=0.5)
            recording.log(f"{self.entity}/limits", lines, static=True)
        if far := [limit for limit in self.limits if not self._is_near(limit)]:
            words = f"limits beyond: {_far_limits(far)}"
            if len(words) > int((self.canvas.width - text_width(self.labels[1]) + 30.0) / TEXT.character):
                words = "other limits lie beyond"
            place = np.array([[self.canvas.width - 0.5 * text_width(words), -0.7 * TEXT.line]])
            recording.log(f"{self.entity}/limits_beyond", labels([words], place, SCREEN.limit), static=True)
        if len(self.curves):
            self.draw(recording, self.instants, self.curves, static=True)

    def draw(self, recording: rr.RecordingStream, instants: Times, curves: Series, *, static: bool = False) -> None:
        """Draw curves (curves, instants) and their names, at the current time or for all times."""
        low, high = self.canvas.low, self.canvas.high  # what leaves the picture follows its edge
        points = [np.stack([instants, curve], axis=-1) for curve in curves]
        finite = [each[np.isfinite(each).all(axis=-1)] for each in points]
        strips = [self.canvas.place(np.clip(each, low, high)) for each in finite]
        lines = []
        if not self.dots:
            radii = rr.Radius.ui_points(MARKS.line / 2)
            lines = [rr.LineStrips2D(strips, colors=list(self.colours), radii=radii, draw_order=1.0)]
        recording.log(f"{self.entity}/curves", *lines, self._dots(strips), static=static)
        if len(curves) > 1:
            ends = [strip[-1, 1] if len(strip) else 0.5 * self.canvas.height for strip in strips]
            recording.log(
                f"{self.entity}/names", labels(self.names, self._name_places(ends), self.colours), static=static
            )

    def _dots(self, strips: Sequence[np.ndarray]) -> rr.Points2D:
        """Return the points of curves as dots if no line shows them."""
        dotted = [strip if self.dots or len(strip) == 1 else strip[:0] for strip in strips]
        colours = [colour for colour, strip in zip(self.colours, dotted, strict=True) for _ in strip]
        radius = rr.Radius.ui_points(2.2 if max(map(len, dotted)) > MARKS.many_dots else 3.2)
        order = 1.0 if self.dots else 3.0  # a single dot is visible on the cursor
        return rr.Points2D(np.concatenate(dotted), colors=colours, radii=radius, draw_order=order)

    def log_cursor(self, recording: rr.RecordingStream, instant: float) -> None:
        """Draw a line at an instant, at the current time."""
        self._log_cursor_style(recording)
        recording.log(f"{self.entity}/cursor", rr.LineStrips2D.from_fields(strips=self._cursors(np.array([instant]))))

    def send_cursor(self, recording: rr.RecordingStream, columns: Sequence[rr.TimeColumn], instants: Times) -> None:
        """Draw a line at each of `instants`; one row of `columns` per instant."""
        self._log_cursor_style(recording)
        strips = rr.LineStrips2D.columns(strips=self._cursors(instants))
        recording.send_columns(f"{self.entity}/cursor", columns, strips)

    def _log_cursor_style(self, recording: rr.RecordingStream) -> None:
        style = rr.LineStrips2D.from_fields(colors=SCREEN.text, radii=rr.Radius.ui_points(0.8), draw_order=2.0)
        recording.log(f"{self.entity}/cursor", style, static=True)

    def _cursors(self, instants: Times) -> list[np.ndarray]:
        low, high = self.canvas.low[1], self.canvas.high[1]
        return list(self.canvas.place(np.array([[(instant, low), (instant, high)] for instant in instants])))

    @cached_property
    def canvas(self) -> Canvas:
        """The canvas of the chart."""
        shown = curve_points(self.instants, self.curves) if self.shown is None else self.shown
        points = shown[np.isfinite(shown).all(axis=-1)]
        low, high = window(self._with_limits(points) if len(points) else np.array([[0.0, 0.0], [1.0, 1.0]]))
        if len(points) and np.ptp(points[:, 0]) > 0:
            low[0], high[0] = points[:, 0].min(), points[:, 0].max()
            if self.dots:  # whole dots, not cut by the frame
                margin = MARKS.dot_margin * (high[0] - low[0])
                low[0], high[0] = low[0] - margin, high[0] + margin
        width = self.total[0] - TEXT.left - self._right
        height = self.total[1] - TEXT.top - TEXT.bottom
        return Canvas(low=low, high=high, labels=self.labels, width=width, height=height)

    def _with_limits(self, points: np.ndarray) -> np.ndarray:
        """Return points together with the values of nearby limits.

        If all values are 0, return all limits, and the usual values if all limits are 0.
        """
        low, high = points[:, 1].min(), points[:, 1].max()
        limits = np.concatenate([np.zeros(0), *(limit.values for limit in self.limits)])
        size, limits = max(abs(low), abs(high)), limits[np.isfinite(limits)]
        if size > DRAWING.rounding * np.abs(limits).max(initial=self.usual):
            reach = DRAWING.limit_distance * max(high - low, 0.2 * size)
            limits = limits[(limits >= low - reach) & (limits <= high + reach)]
        elif not (np.abs(limits) > DRAWING.rounding * self.usual).any():
            limits = np.append(limits, np.array([-1.0, 1.0]) * (self.usual or 1.0))
        values = np.concatenate([points[:, 1], limits])
        return np.stack([np.resize(points[:, 0], len(values)), values], axis=1)

    def _is_near(self, limit: LimitLine) -> bool:
        inside = (limit.values >= self.canvas.low[1]) & (limit.values <= self.canvas.high[1])
        return bool(inside.any())

    def _dashes(self, limit: LimitLine) -> list[np.ndarray]:
        """Return a limit as dashes, cut at the edge of the picture."""
        low, high = self.canvas.low, self.canvas.high
        count = int(self.canvas.width / MARKS.dash)
        x = np.linspace(low[0], high[0], count + 1)
        values = (
            np.interp(x, limit.instants, limit.values) if len(limit.values) > 1 else np.full(len(x), limit.values[0])
        )
        placed = self.canvas.place(np.stack([x, values], axis=1))
        seen = np.isfinite(values) & (values >= low[1]) & (values <= high[1])
        return [placed[i : i + 2] for i in range(0, count, 2) if seen[i] and seen[i + 1]]

    def _name_places(self, ends: Sequence[float]) -> Values:
        """Return the middles of names, right of the ends of their curves, in as many columns as needed."""
        highest = -0.4 * TEXT.line
        lowest = highest + self.canvas.height  # below are the words of ticks
        moved = _spread_labels(ends, gap=TEXT.line / self._name_columns, highest=highest, lowest=lowest)
        longest = text_width(max(self.names, key=len))
        order = np.argsort(np.argsort(moved, kind="stable"), kind="stable")
        column = order % self._name_columns
        x = self.canvas.width + 12.0 + (longest + 8.0) * column
        return np.stack([x + 0.5 * np.array([text_width(name) for name in self.names]), moved], axis=1)

    @property
    def _name_columns(self) -> int:
        room = self.total[1] - TEXT.top - TEXT.bottom + TEXT.line
        return max(1, int(np.ceil(len(self.names) * TEXT.line / room)))

    @property
    def _right(self) -> float:
        if len(self.names) < 2:
            return TEXT.right
        return min(0.5 * self.total[0], 16.0 + (text_width(max(self.names, key=len)) + 8.0) * self._name_columns)


def fit_below_tabs(charts: Sequence[Chart], names_before: Sequence[str] = ()) -> list[Chart]:
    """Return charts that are tabs below a view; nested tabs are lower by their row of names.

    ``names_before``: names of further tabs before them.
    """
    names = [*names_before, *(screen_text(chart.title) for chart in charts)]
    nested = nested_tabs(names, VIEWS.panels[0])[len(names_before) :]
    lower = (VIEWS.chart[0], VIEWS.chart[1] - VIEWS.title)
    return [replace(chart, total=lower) if inner else chart for chart, inner in zip(charts, nested, strict=True)]


def curve_points(instants: Times, curves: Series) -> Float[np.ndarray, "points 2"]:
    """Return all points of curves (curves, instants), curve after curve."""
    return np.stack([np.tile(instants, len(curves)), np.ravel(curves)], axis=1)


def _far_limits(limits: Sequence[LimitLine]) -> str:
    """Return limits in words, grouped by name."""
    by_name: dict[str, list[str]] = {}
    for limit in limits:
        finite = limit.values[np.isfinite(limit.values)]
        if len(finite):
            by_name.setdefault(limit.name, []).append(tick_text(float(finite[np.abs(finite).argmin()])))
    return ", ".join(f"{name} {' and '.join(values)}".strip() for name, values in by_name.items())


def _spread_labels(
    places: Sequence[float], *, gap: float, highest: float = -np.inf, lowest: float = np.inf
) -> list[float]:
    """Return `places`, in their order, with the smallest squared moves that keep neighbours at least `gap` apart.

    Crowded labels keep their common middle, and others stay. None is above ``highest`` if there is enough space, and
    none is below ``lowest``.
    """
    from scipy.optimize import isotonic_regression  # here: it loads slowly

    order, steps = np.argsort(places, kind="stable"), gap * np.arange(len(places))
    offsets = isotonic_regression(np.array(places, dtype=float)[order] - steps).x
    moved = np.zeros(len(places))
    moved[order] = np.minimum(np.maximum(offsets, highest), lowest - steps[-1]) + steps
    return list(moved)
