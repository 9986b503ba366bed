"""The panel of a plan: the objective at every start, at its result, and at the optima, level by level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Values
from paretoik.review.drawing.axes import TEXT, Canvas, labels, window
from paretoik.review.drawing.labels import joined_label, label_points, line_points, no_label
from paretoik.review.palette import DRAWING, MARKS, SCREEN, Colour, screen_label
from paretoik.review.recording.messages import PlannedLevel, PlannedOptimum, PlannedScene

ENTITY = "objective"
BEST = "best"  # name of the best point


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanPanel:
    """One band per level, with its starts in the order of the search, and one band of the final ``optima``.

    A band has width 1, and its marks keep off its borders. Values that are too far away are dashes at the edge.
    """

    scene: PlannedScene
    levels: Sequence[PlannedLevel]
    optima: Sequence[PlannedOptimum]

    def view(self) -> rrb.View:
        """Return the view."""
        bounds = self.canvas.bounds()
        return rrb.Spatial2DView(
            origin=ENTITY, name="objective at starts", visual_bounds=bounds, background=SCREEN.background
        )

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, borders between bands with the name of each below it, and the final optima, for all times."""
        canvas = self.canvas
        canvas.log(recording, ENTITY, static=True)
        style = rr.LineStrips2D(self._borders, colors=SCREEN.frame, radii=rr.Radius.ui_points(0.7), draw_order=0.2)
        recording.log(f"{ENTITY}/levels/lines", style, static=True)
        words = [f"{level.samples} samples" for level in self.levels] + ["optima"] * bool(self.optima)
        middles = canvas.place(np.array([(band + 0.5, canvas.low[1]) for band in range(len(words))]).reshape(-1, 2))
        title = np.array([[canvas.width / 2, canvas.height + 1.75 * TEXT.line]])
        places = np.concatenate([middles + np.array([0.0, 0.7 * TEXT.line]), title])
        names = labels([*words, "level by level, its starts in the order of the search"], places)
        recording.log(f"{ENTITY}/levels/names", names, static=True)
        lines = rr.LineStrips2D(self._value_lines, colors=SCREEN.final, radii=rr.Radius.ui_points(0.7), draw_order=0.5)
        recording.log(f"{ENTITY}/final", lines, static=True)

    def log_until(
        self, recording: rr.RecordingStream, count: int, *, ended: bool = False, looked_at: int | None = None
    ) -> None:
        """Draw the first ``count`` starts with their results and the best of the level; the optima if all ``ended``.

        Labels avoid the cursor of the start ``looked_at``, by its number from 1. Values of other levels are not
        comparable, because these have other samples.
        """
        across = self.across[:count]
        starts, ends = self.starts[:count], self.ends[:count]
        failed, borders = ~np.isfinite(ends), np.cumsum([0, *(len(level.starts) for level in self.levels)])
        first = int(borders[borders < count].max(initial=0))  # of the level of the last start
        self._log_starts(recording, "starts", across[~failed], starts[~failed], SCREEN.population)
        self._log_starts(recording, "failed", across[failed], starts[failed], SCREEN.failed)
        self._log_points(recording, "ends", across[~failed], ends[~failed], SCREEN.front, 3.2, 2.0)
        places = self._places if ended else np.zeros(0)
        self._log_points(recording, "optima", places, self._final[: len(places)], SCREEN.front, 4.5, 3.0)
        where, best = np.zeros(0), np.zeros(0)  # a level without an optimum has no best
        if ended and len(places):
            where, best = places[:1], self._final[:1]
        elif np.isfinite(ends[first:]).any():
            row = first + int(np.nanargmax(ends[first:]) if self.scene.maximised else np.nanargmin(ends[first:]))
            where, best = across[row, None], ends[row, None]
        self._log_points(recording, "best", where, best, SCREEN.chosen, 6.5, 4.0, [BEST])
        if len(where):
            cursor = [] if looked_at is None else [self._cursor(looked_at)]
            self._log_name(recording, "best", float(where[0]), float(best[0]), BEST, SCREEN.chosen, cursor)
        else:
            recording.log(f"{ENTITY}/best/name", *no_label())
        self._log_none_looked_at(recording)

    def log_start(self, recording: rr.RecordingStream, number: int) -> None:
        """Mark a start by its number, from 1, and its result."""
        cursor = rr.LineStrips2D(
            [self._cursor(number)], colors=SCREEN.text, radii=rr.Radius.ui_points(0.8), draw_order=0.8
        )
        recording.log(f"{ENTITY}/cursor", cursor)

    def log_optimum(self, recording: rr.RecordingStream, place: int) -> None:
        """Mark a final optimum that is looked at, by its place; the best is already marked and stays the best."""
        if place == 0:
            self._log_none_looked_at(recording)
            return
        where = self._places[min(place, DRAWING.optima - 1), None]
        value = np.array([self.optima[place].point.objectives[0]])
        words = f"optimum {place}"
        self._log_points(recording, "looked_at", where, value, SCREEN.arm, 6.5, 4.5, [words])
        self._log_name(recording, "looked_at", float(where[0]), float(value[0]), words, SCREEN.arm)

    def _log_none_looked_at(self, recording: rr.RecordingStream) -> None:
        self._log_points(recording, "looked_at", np.zeros(0), np.zeros(0), SCREEN.arm, 6.5, 4.5)
        recording.log(f"{ENTITY}/looked_at/name", *no_label())

    @cached_property
    def starts(self) -> Values:
        """The objective at all starts (starts,), level after level."""
        return np.concatenate([np.zeros(0), *(level.starts for level in self.levels)])

    @cached_property
    def ends(self) -> Values:
        """The objective at the results of all starts (starts,), NaN if a result is not an optimum."""
        return np.concatenate([np.zeros(0), *(level.ends for level in self.levels)])

    @cached_property
    def across(self) -> Values:
        """The horizontal places of all starts (starts,), in the band of their level."""
        bands = [self._across_band(place, len(level.starts)) for place, level in enumerate(self.levels)]
        return np.concatenate([np.zeros(0), *bands])

    @cached_property
    def canvas(self) -> Canvas:
        """The canvas of the panel."""
        optima = np.concatenate([self._final, *(level.optima[:1] for level in self.levels)])
        reached = self.ends[np.isfinite(self.ends)]
        share = 1 - DRAWING.near if self.scene.maximised else DRAWING.near
        seen = np.append(optima, np.quantile(reached, share) if len(reached) else [])
        seen = seen[np.isfinite(seen)] if np.isfinite(seen).any() else self.starts[np.isfinite(self.starts)]
        seen = seen if len(seen) else np.zeros(1)
        low, high = float(seen.min()), float(seen.max())
        reach = 1.5 * max(high - low, 0.02 * max(abs(low), abs(high)), 1e-12)
        near = np.concatenate([seen, self.starts, reached])
        sign = -1.0 if self.scene.maximised else 1.0
        best, worst = sorted((sign * low, sign * high))
        is_near = (sign * near >= best - DRAWING.better * reach) & (sign * near <= worst + reach)
        near = near[np.isfinite(near) & is_near]
        corners = np.stack([np.resize([0.0, self._end], len(near) + 2), np.append(near, [low, high])], axis=1)
        low_corner, high_corner = window(corners, margin=0.06)
        low_corner[0], high_corner[0] = 0.0, self._end
        label = screen_label(self.scene.name, self.scene.unit, self.scene.maximised)
        return Canvas(low=low_corner, high=high_corner, labels=("", label), ticked=(False, True))

    def beyond(self, level: PlannedLevel) -> int:
        """Return how many of a level's starts are too far away, at the edge."""
        return int(sum(not self._is_near(value) for value in level.starts))

    @property
    def _final(self) -> Values:
        return np.array([each.point.objectives[0] for each in self.optima[: DRAWING.optima]], dtype=float)

    @property
    def _end(self) -> float:
        return float(max(len(self.levels) + bool(self.optima), 1))

    @property
    def _places(self) -> Values:
        """The horizontal places of the final optima."""
        return self._across_band(len(self.levels), len(self._final))

    def _across_band(self, place: int, count: int) -> Values:
        """Return ``count`` places of marks in a band; no mark crosses a border."""
        margin = min(MARKS.band_margin * self._end / self.canvas.width, 0.25)
        shares = (np.arange(count) + 0.5) / max(count, 1)
        return np.asarray(place + margin + (1.0 - 2.0 * margin) * shares)

    def _is_near(self, value: float) -> bool:
        return bool(self.canvas.low[1] <= value <= self.canvas.high[1])

    def _log_starts(
        self,
        recording: rr.RecordingStream,
        layer: str,
        across: Float[np.ndarray, " points"],
        values: Values,
        colour: Colour,
    ) -> None:
        """Draw starts: as dots in the axes, otherwise as dashes that point towards them."""
        near = (values >= self.canvas.low[1]) & (values <= self.canvas.high[1])
        self._log_points(recording, layer, across[near], values[near], colour, MARKS.start, 1.0)
        strips = list[np.ndarray]()
        for x, value in zip(across[~near & np.isfinite(values)], values[~near & np.isfinite(values)], strict=True):
            edge, inwards = (self.canvas.high[1], 1.0) if value > self.canvas.high[1] else (self.canvas.low[1], -1.0)
            tip = self.canvas.place(np.array([x, edge]))
            strips.append(tip + np.array([(0.0, 0.0), (0.0, inwards * MARKS.edge_dash)]))
        lines = rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(0.8), draw_order=1.0)
        recording.log(f"{ENTITY}/{layer}/beyond", lines)

    def _log_points(
        self,
        recording: rr.RecordingStream,
        layer: str,
        across: Float[np.ndarray, " points"],
        values: Values,
        colour: Colour,
        radius: float,
        order: float,
        names: Sequence[str] | None = None,
    ) -> None:
        places = np.stack([across, np.clip(values, self.canvas.low[1], self.canvas.high[1])], axis=1)
        seen = np.isfinite(values)
        drawn = rr.Points2D(
            self.canvas.place(places[seen]),
            colors=colour,
            radii=rr.Radius.ui_points(radius),
            labels=names if names and seen.any() else None,
            show_labels=False,
            draw_order=order,
        )
        recording.log(f"{ENTITY}/{layer}", drawn)

    def _log_name(
        self,
        recording: rr.RecordingStream,
        layer: str,
        across: float,
        value: float,
        words: str,
        colour: Colour,
        lines: Sequence[np.ndarray] = (),
    ) -> None:
        """Name a point, off everything drawn, further ``lines`` [pixels], and the name of the best if another point."""
        canvas, others = self.canvas, np.concatenate([self._drawn, line_points(np.array(lines).reshape(-1, 2, 2))])
        low, high = canvas.low[1], canvas.high[1]
        mark = canvas.place(np.array([across, np.clip(value, low, high)]))
        if layer == "looked_at":
            best = canvas.place(np.array([self._places[0], np.clip(self._final[0], low, high)]))
            others = np.concatenate([others, label_points(canvas, best, BEST, others)])
        recording.log(f"{ENTITY}/{layer}/name", *joined_label(canvas, mark, words, others, colour))

    @cached_property
    def _drawn(self) -> Float[np.ndarray, "points 2"]:
        """Points [pixels] on starts, results, optima, their value lines, and borders of levels."""
        canvas = self.canvas
        x = np.concatenate([self.across, self.across, self._places])
        values = np.concatenate([self.starts, self.ends, self._final])
        seen = np.isfinite(values)
        clipped = np.clip(values[seen], canvas.low[1], canvas.high[1])
        marks = canvas.place(np.stack([x[seen], clipped], axis=1))
        return np.concatenate([marks, line_points(np.array([*self._value_lines, *self._borders]).reshape(-1, 2, 2))])

    @property
    def _value_lines(self) -> list[np.ndarray]:
        """Lines [pixels] at the values of the final optima."""
        final = [np.array([(0.0, value), (self._end, value)]) for value in self._final if self._is_near(value)]
        return [self.canvas.place(line) for line in final]

    @property
    def _borders(self) -> list[np.ndarray]:
        """Lines [pixels] between bands."""
        return [self._upright(float(x)) for x in np.arange(1, int(self._end))]

    def _cursor(self, number: int) -> np.ndarray:
        """Return the line [pixels] at a start by its number, from 1."""
        return self._upright(float(self.across[number - 1]))

    def _upright(self, x: float) -> np.ndarray:
        return self.canvas.place(np.array([(x, self.canvas.low[1]), (x, self.canvas.high[1])]))
