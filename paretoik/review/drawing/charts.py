"""Curves over a search or a motion, drawn by hand: Rerun's series view is empty while another timeline plays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Series, Times
from paretoik.review.drawing.axes import (
    TEXT,
    Canvas,
    flat_dots,
    flat_lines,
    flat_view,
    labels,
    screen_text,
    text_width,
    tick_text,
    window,
)
from paretoik.review.drawing.layout import nested_tabs
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, Colour


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitLine:
    """A limit over ``instants``: its ``values``, colours, and the name of the limited joint ("" for all joints).

    If several joints share a limit, its dashes alternate between their ``colours``.
    """

    instants: Times
    values: Times
    name: str
    colours: Sequence[Colour]


@dataclass(frozen=True, kw_only=True, eq=False)
class Chart:
    """Named curves at ``entity``, on axes that contain all of ``shown`` and the nearby limits.

    curves: values (curves, instants) that are drawn for all times; without them ``draw`` draws the curves
    shown: all points (points, 2) drawn at any time, by default the curves; non-finite values are left out
    usual: typical size of values; if all values are negligible relative to it and to the limits, the axes contain all
        limits, or values of this size if the limits are negligible too
    dots: whether no lines join the points; a curve of one point is always a dot
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

    @staticmethod
    def over(
        across: str, name: str, label: str, instants: Times, curves: Series, colours: Sequence[Colour], **more: Any
    ) -> Chart:
        """Return the chart ``name`` of curves with one ``label``."""
        settings: dict[str, Any] = {"title": label, "names": [label] * len(colours), **more}
        return Chart(
            entity=f"charts/{name}",
            labels=(across, label),
            instants=instants,
            curves=curves,
            colours=colours,
            **settings,
        )

    def view(self) -> rrb.View:
        """Return the chart's view."""
        return flat_view(self.entity, screen_text(self.title), self.canvas.bounds(right=self._right))

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, limits and the curves, for all times."""
        canvas, dashes, colours, far = self.canvas, list[np.ndarray](), list[Colour](), dict[str, list[str]]()
        canvas.log(recording, self.entity)
        count, (low, high) = int(canvas.width / MARKS.dash), (canvas.low, canvas.high)
        x = np.linspace(low[0], high[0], count + 1)
        for limit in self.limits:
            if not ((limit.values >= low[1]) & (limit.values <= high[1])).any():
                finite = limit.values[np.isfinite(limit.values)]
                if len(finite):
                    far.setdefault(limit.name, []).append(tick_text(float(finite[np.abs(finite).argmin()])))
                continue
            values = np.interp(x, limit.instants, limit.values)
            placed = canvas.place(np.stack([x, values], axis=1))
            seen = np.isfinite(values) & (values >= low[1]) & (values <= high[1])
            strips = [placed[i : i + 2] for i in range(0, count, 2) if seen[i] and seen[i + 1]]
            colours += [limit.colours[number % len(limit.colours)] for number in range(len(strips))]
            dashes += strips
        if dashes:
            recording.log(f"{self.entity}/limits", flat_lines(dashes, colours, 0.9, 0.5), static=True)
        if far:
            words = ", ".join(f"{name} {' and '.join(values)}".strip() for name, values in far.items())
            words = f"limits beyond: {words}"
            if len(words) > int((canvas.width - text_width(self.labels[1]) + 30.0) / TEXT.character):
                words = "other limits lie beyond"
            place = np.array([[canvas.width - 0.5 * text_width(words), -0.7 * TEXT.line]])
            recording.log(f"{self.entity}/limits_beyond", labels([words], place, SCREEN.limit), static=True)
        if len(self.curves):
            self.draw(recording, self.instants, self.curves, static=True)

    def draw(self, recording: rr.RecordingStream, instants: Times, curves: Series, *, static: bool = False) -> None:
        """Draw curves (curves, instants) and their names, at the current time or for all times."""
        low, high = self.canvas.low, self.canvas.high  # points outside the axes are drawn at their edge
        points = [np.stack([instants, curve], axis=-1) for curve in curves]
        finite = [each[np.isfinite(each).all(axis=-1)] for each in points]
        strips = [self.canvas.place(np.clip(each, low, high)) for each in finite]
        lines = [] if self.dots else [flat_lines(strips, list(self.colours), MARKS.line / 2, 1.0)]
        dotted = [strip if self.dots or len(strip) == 1 else strip[:0] for strip in strips]  # curves without lines
        colours = [colour for colour, strip in zip(self.colours, dotted, strict=True) for _ in strip]
        radius = 2.2 if max(map(len, dotted)) > MARKS.many_dots else 3.2
        order = 1.0 if self.dots else 3.0  # above the cursor, if a curve is a single dot
        dots = flat_dots(np.concatenate(dotted), colours, radius, order)
        recording.log(f"{self.entity}/curves", *lines, dots, static=static)
        if len(curves) > 1:
            from scipy.optimize import isotonic_regression  # here: it loads slowly

            # The names are right of the ends of their curves, in as many columns as needed. Crowded names move apart
            # around their common middle, as little as possible.
            ends = [strip[-1, 1] if len(strip) else 0.5 * self.canvas.height for strip in strips]
            highest, gap = -0.4 * TEXT.line, TEXT.line / self._name_columns
            lowest = highest + self.canvas.height  # the words of ticks are below it
            rank, steps = np.argsort(ends, kind="stable"), gap * np.arange(len(ends))
            offsets = isotonic_regression(np.array(ends, dtype=float)[rank] - steps).x
            moved = np.zeros(len(ends))
            moved[rank] = np.minimum(np.maximum(offsets, highest), lowest - steps[-1]) + steps
            longest = text_width(max(self.names, key=len))
            column = np.argsort(np.argsort(moved, kind="stable"), kind="stable") % self._name_columns
            x = self.canvas.width + 12.0 + (longest + 8.0) * column
            middles = np.stack([x + 0.5 * np.array([text_width(name) for name in self.names]), moved], axis=1)
            names = labels(self.names, middles, self.colours)
            recording.log(f"{self.entity}/names", names, static=static)

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
        low, high = window(points if len(points) else np.array([[0.0, 0.0], [1.0, 1.0]]))
        if len(points):
            # nearby limits; if values are negligible, all limits, or values of the usual size
            least, most = points[:, 1].min(), points[:, 1].max()
            limits = np.concatenate([np.zeros(0), *(limit.values for limit in self.limits)])
            size, limits = max(abs(least), abs(most)), limits[np.isfinite(limits)]
            if size > DRAWING.rounding * np.abs(limits).max(initial=self.usual):
                reach = DRAWING.limit_distance * max(most - least, 0.2 * size)
                limits = limits[(limits >= least - reach) & (limits <= most + reach)]
            elif not (np.abs(limits) > DRAWING.rounding * self.usual).any():
                limits = np.append(limits, np.array([-1.0, 1.0]) * (self.usual or 1.0))
            values = np.concatenate([points[:, 1], limits])
            low, high = window(np.stack([np.resize(points[:, 0], len(values)), values], axis=1))
        if len(points) and np.ptp(points[:, 0]) > 0:
            low[0], high[0] = points[:, 0].min(), points[:, 0].max()
            if self.dots:  # whole dots, not cut by the frame
                margin = MARKS.dot_margin * (high[0] - low[0])
                low[0], high[0] = low[0] - margin, high[0] + margin
        width = self.total[0] - TEXT.left - self._right
        height = self.total[1] - TEXT.top - TEXT.bottom
        return Canvas(low=low, high=high, labels=self.labels, width=width, height=height)

    @property
    def _name_columns(self) -> int:
        room = self.total[1] - TEXT.top - TEXT.bottom + TEXT.line
        return max(1, int(np.ceil(len(self.names) * TEXT.line / room)))

    @property
    def _right(self) -> float:
        if len(self.names) < 2:
            return TEXT.right
        return min(0.5 * self.total[0], 16.0 + (text_width(max(self.names, key=len)) + 8.0) * self._name_columns)


def fit_below_tabs(charts: Sequence[Chart]) -> list[Chart]:
    """Return charts resized as tabs below a view; nested tabs have less height."""
    nested = nested_tabs([screen_text(chart.title) for chart in charts], VIEWS.panels[0])
    lower = (VIEWS.chart[0], VIEWS.chart[1] - VIEWS.title)
    return [replace(chart, total=lower) if inner else chart for chart, inner in zip(charts, nested, strict=True)]


def curve_points(instants: Times, curves: Series) -> Float[np.ndarray, "points 2"]:
    """Return all points of curves (curves, instants), curve after curve."""
    return np.stack([np.tile(instants, len(curves)), np.ravel(curves)], axis=1)
