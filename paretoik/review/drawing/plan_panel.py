"""The panel of a plan: the objective at every start, at its result, and at the optima, level by level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Mask, Values
from paretoik.review.drawing.axes import TEXT, Canvas, labels, window
from paretoik.review.drawing.label_places import joined_labels, label_area, label_place, line_points
from paretoik.review.palette import DRAWING, MARKS, SCREEN, Colour, screen_label
from paretoik.review.recording.messages import PlannedLevel, PlannedOptimum, PlannedScene

ENTITY = "objective"
BEST = "best"  # name of the best point


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanPanel:
    """One band per level, with its starts in the order of the search, and one band of the final ``optima``.

    A band has width 1, and no mark touches its borders. Values that are too far away are dashes at the edge.
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
        canvas.log(recording, ENTITY)
        for entity, lines, colour, order in (
            ("levels/lines", self._borders, SCREEN.frame, 0.2),
            ("final", self._value_lines, SCREEN.final, 0.5),
        ):
            strips = rr.LineStrips2D(lines, colors=colour, radii=rr.Radius.ui_points(0.7), draw_order=order)
            recording.log(f"{ENTITY}/{entity}", strips, static=True)
        words = [f"{level.samples} samples" for level in self.levels] + ["optima"] * bool(self.optima)
        middles = canvas.place(np.array([(band + 0.5, canvas.low[1]) for band in range(len(words))]).reshape(-1, 2))
        title = np.array([[canvas.width / 2, canvas.height + 1.75 * TEXT.line]])
        places = np.concatenate([middles + np.array([0.0, 0.7 * TEXT.line]), title])
        names = labels([*words, "level by level, its starts in the order of the search"], places)
        recording.log(f"{ENTITY}/levels/names", names, static=True)

    def log_until(
        self, recording: rr.RecordingStream, count: int, *, ended: bool = False, looked_at: int | None = None
    ) -> None:
        """Draw the first ``count`` starts with their results, and the level's best.

        If the plan has ``ended``, its optima are drawn too. A cursor is at the start ``looked_at``, by its number from
        1, and labels avoid it. Values of other levels are not comparable, because these have other samples.
        """
        across, starts, ends = self.across[:count], self.starts[:count], self.ends[:count]
        failed, borders = ~np.isfinite(ends), np.cumsum([0, *(len(level.starts) for level in self.levels)])
        first = int(borders[borders < count].max(initial=0))  # first start of the level of the last one
        for layer, rows, colour in (("starts", ~failed, SCREEN.population), ("failed", failed, SCREEN.failed)):
            # dots in the axes; those beyond are dashes that point towards them
            x, values, (low, high) = across[rows], starts[rows], (self.canvas.low[1], self.canvas.high[1])
            near, strips = self._is_near(values), list[np.ndarray]()
            self._log_points(recording, layer, x[near], values[near], colour, MARKS.start, 1.0)
            for at, value in zip(x[~near & np.isfinite(values)], values[~near & np.isfinite(values)], strict=True):
                tip = self.canvas.place(np.array([at, np.clip(value, low, high)]))
                strips.append(
                    tip + np.array([(0.0, 0.0), (0.0, MARKS.edge_dash if value > high else -MARKS.edge_dash)])
                )
            lines = rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(0.8), draw_order=1.0)
            recording.log(f"{ENTITY}/{layer}/beyond", lines)
        self._log_points(recording, "ends", across[~failed], ends[~failed], SCREEN.front, 3.2, 2.0)
        places = self._places if ended else np.zeros(0)
        self._log_points(recording, "optima", places, self._final[: len(places)], SCREEN.front, 4.5, 3.0)
        where, best = places[:1], self._final[: len(places[:1])]
        if not len(where) and np.isfinite(ends[first:]).any():  # a level without an optimum has no best
            row = first + int(np.nanargmax(ends[first:]) if self.scene.maximised else np.nanargmin(ends[first:]))
            where, best = across[row, None], ends[row, None]
        cursors = [] if looked_at is None else [self._upright(float(self.across[looked_at - 1]))]
        self._log_named(recording, "best", where, best, SCREEN.chosen, 4.0, BEST, cursors)
        self._log_named(recording, "looked_at", np.zeros(0), np.zeros(0), SCREEN.arm, 4.5, "")
        if looked_at is not None:
            line = rr.LineStrips2D(cursors, colors=SCREEN.text, radii=rr.Radius.ui_points(0.8), draw_order=0.8)
            recording.log(f"{ENTITY}/cursor", line)

    def log_optimum(self, recording: rr.RecordingStream, place: int) -> None:
        """Mark the final optimum at a place as looked at; the best keeps its mark."""
        where = self._places[min(place, DRAWING.optima - 1), None][: int(place > 0)]
        value = np.array([self.optima[place].point.objectives[0]])[: len(where)]
        self._log_named(recording, "looked_at", where, value, SCREEN.arm, 4.5, f"optimum {place}")

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
        return int((~self._is_near(level.starts)).sum())

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

    def _is_near(self, values: Values) -> Mask:
        return np.asarray((values >= self.canvas.low[1]) & (values <= self.canvas.high[1]))

    def _mark(self, across: Values, values: Values) -> Float[np.ndarray, "points 2"]:
        """Return the positions of points [pixels].

        Points beyond the axes are at their edge; points without a value are left out.
        """
        clipped = np.clip(values, self.canvas.low[1], self.canvas.high[1])
        return self.canvas.place(np.stack([across, clipped], axis=1)[np.isfinite(values)])

    def _log_points(
        self,
        recording: rr.RecordingStream,
        layer: str,
        across: Values,
        values: Values,
        colour: Colour,
        radius: float,
        order: float,
        name: str = "",
    ) -> None:
        at, radii = self._mark(across, values), rr.Radius.ui_points(radius)
        names = [name] if name and len(at) else None
        points = rr.Points2D(at, colors=colour, radii=radii, labels=names, show_labels=False, draw_order=order)
        recording.log(f"{ENTITY}/{layer}", points)

    def _log_named(
        self,
        recording: rr.RecordingStream,
        layer: str,
        across: Values,
        values: Values,
        colour: Colour,
        order: float,
        words: str,
        lines: Sequence[np.ndarray] = (),
    ) -> None:
        """Draw a point, or none, with its name.

        The name avoids everything drawn, further ``lines`` [pixels], and the name of the best point.
        """
        self._log_points(recording, layer, across, values, colour, 6.5, order, words)
        canvas, marks, middles = self.canvas, self._mark(across, values), list[np.ndarray]()
        for mark in marks:
            others = np.concatenate([self._drawn, line_points(np.array(lines).reshape(-1, 2, 2))])
            if layer == "looked_at":
                best = self._mark(self._places[:1], self._final[:1])[0]
                others = np.concatenate([others, label_area(label_place(canvas, best, BEST, others), BEST)])
            middles.append(label_place(canvas, mark, words, others))
        recording.log(f"{ENTITY}/{layer}/name", *joined_labels(marks, middles, [words] * len(marks), colour))

    @cached_property
    def _drawn(self) -> Float[np.ndarray, "points 2"]:
        """Points [pixels] on starts, results, optima, their value lines, and borders of levels."""
        x = np.concatenate([self.across, self.across, self._places])
        marks = self._mark(x, np.concatenate([self.starts, self.ends, self._final]))
        return np.concatenate([marks, line_points(np.array([*self._value_lines, *self._borders]).reshape(-1, 2, 2))])

    @property
    def _value_lines(self) -> list[np.ndarray]:
        """Lines [pixels] at the values of the final optima."""
        final = self._final[self._is_near(self._final)]
        return [self.canvas.place(np.array([(0.0, value), (self._end, value)])) for value in final]

    @property
    def _borders(self) -> list[np.ndarray]:
        """Lines [pixels] between bands."""
        return [self._upright(float(x)) for x in np.arange(1, int(self._end))]

    def _upright(self, x: float) -> np.ndarray:
        return self.canvas.place(np.array([(x, self.canvas.low[1]), (x, self.canvas.high[1])]))
