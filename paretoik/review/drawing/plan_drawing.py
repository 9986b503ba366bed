"""The recording of a plan: its levels with their starts, then its optima and their motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Mask, Values
from paretoik.review.drawing.axes import (
    TEXT,
    Canvas,
    flat_dots,
    flat_lines,
    flat_view,
    labels,
    screen_text,
    window,
)
from paretoik.review.drawing.charts import Chart, curve_points
from paretoik.review.drawing.label_places import joined_labels, label_area, label_place, line_points
from paretoik.review.drawing.layout import Layout, Legend, drawn_entries, log_text, set_times, text_view
from paretoik.review.drawing.motion import MotionScene, ReplayClock, motion_views
from paretoik.review.drawing.point_text import infeasible_text
from paretoik.review.palette import DRAWING, MARKS, SCREEN, Colour, even_rows, screen_label
from paretoik.review.recording.messages import (
    PlanEnd,
    PlannedLevel,
    PlannedOptimum,
    PlannedScene,
    RecordedMotion,
    RecordedPoint,
)
from paretoik.review.words import counted, run_text, value_text
from paretoik.task.limits import JOINT_UNITS

# The texts of a plan, in Markdown.


def level_text(panel: PlanPanel, level: PlannedLevel) -> str:
    """Return the text of a level."""
    starts, failed = counted(len(level.starts), "start"), int((~np.isfinite(level.ends)).sum())
    nearest = level.least_violating
    if nearest is not None:
        counts = f"{starts}; none led to a motion that satisfies all limits. The arm shows the least-violating one."
    else:
        counts = f"{starts}, {counted(len(level.optima), 'distinct optimum', 'distinct optima')}"
        counts += f"; {failed} of the starts led to no optimum." if failed else "."
    lines = [f"# Level {level.number}: {level.samples} samples", counts]
    if beyond := int((~panel.is_near(level.starts)).sum()):
        lines.append(f"{counted(beyond, 'start')} beyond the axes: dashes at their edge.")
    if len(panel.levels) > 1:
        lines.append("Values of different levels are not comparable, because their motions have different samples.")
    if nearest is not None:
        lines += [
            "",
            "Constraints broken by the least-violating motion:",
            "",
            *(f"- {each}" for each in nearest.broken),
        ]
        return screen_text("\n".join(lines))
    lines += ["", "## Optima of the level", ""]
    for place, value in enumerate(level.optima[: DRAWING.optima]):
        hits = int((level.motions.optimum == place).sum())
        lines.append(f"- {place}: {_value(panel.scene, value)}, from {counted(hits, 'start')}")
    return screen_text("\n".join([*lines, *_further(len(level.optima))]))


def start_text(scene: PlannedScene, level: PlannedLevel, row: int) -> str:
    """Return the text of the start of a level at a row."""
    optimum = int(level.motions.optimum[row])
    lines = [
        f"# Start {row + 1} of the {len(level.starts)} of level {level.number}, {level.samples} samples",
        f"- value of the start: {_value(scene, level.starts[row])}",
    ]
    if np.isfinite(level.ends[row]):
        lines.append(f"- value of its result: {_value(scene, level.ends[row])}")
    if optimum >= 0:
        lines.append(f"- leads to optimum {optimum} of the {len(level.optima)} of the level")
    elif np.isfinite(level.ends[row]):
        lines.append("- leads to an optimum that is not kept: too many others, or perturbed ones near it")
    else:
        lines.append("- leads to no optimum: the arm shows where its solver stopped")
    return screen_text("\n".join(lines))


def optimum_text(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int, count: int) -> str:
    """Return the text of the final optimum number ``place``, one of ``count``."""
    optimum, best = optima[place], optima[0]
    value, least = float(optimum.point.objectives[0]), float(best.point.objectives[0])
    worse = f", {100 * abs(value - least) / max(abs(least), 1e-300):.3g}% worse than the best" if place else ""
    lines = [
        f"# Optimum {place} ({place + 1} of {count})" + (", the best" if place == 0 else ""),
        f"- **{scene.name}**{', more is better' if scene.maximised else ''}: {_value(scene, value)}{worse}",
    ]
    if optimum.branch:
        words = "bend of each inner joint, with `~` if it passes through the straight position"
        lines.append(f"- branch {_branch(optimum)}: {words}")
    lines.append(f"- {optimum.status} (local)")
    if np.isfinite(optimum.violation_between):
        lines.append(f"- violation {optimum.violation_between:.2g} of a limit's range on a finer grid")
    else:
        lines.append("- leaves the path between the samples")
    if twin := _twin_words(scene, optima, place):
        lines.append(f"- equal value and branch: {twin}")
    return screen_text("\n".join(lines))


def plan_end_text(scene: PlannedScene, end: PlanEnd, first: int, starts: int) -> str:
    """Return the text of a plan; ``first``, ``starts``: numbers of starts of the first and of all levels."""
    lines = [optimum_text(scene, end.optima, 0, len(end.optima)), "", "## Optima", ""]
    for place, each in enumerate(end.optima[: DRAWING.optima]):
        branch, twin = _branch(each) if each.branch else "", _twin_words(scene, end.optima, place)
        words = (f"- {place}: {_value(scene, each.point.objectives[0])}", branch, twin)
        lines.append(", ".join(filter(None, words)))
    counts = f"The first level had {counted(first, 'start')}"
    counts += (
        f"; later levels begin from the optima of the level before, {starts - first} starts in all."
        if starts > first
        else "."
    )
    return screen_text("\n".join([*lines, *_further(len(end.optima)), "", counts, "", run_text(end.provenance)]))


def _twin_words(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int) -> str:
    """Return text on the difference of an optimum from its twin; "" if it has none.

    The twin is the first earlier optimum with the same printed value and branch. The text has the largest difference of
    a joint at a sample, with its sign.
    """
    words = [(_value(scene, each.point.objectives[0]), each.branch) for each in optima[: place + 1]]
    twin = words.index(words[place])
    motion, reference = optima[place].point.motion, optima[twin].point.motion
    if twin == place or motion is None or reference is None:
        return ""
    difference, arm = motion.q - reference.q, scene.workcell.arm
    row, joint = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
    amount = f"{difference[row, joint]:+.3g} {JOINT_UNITS['position'][arm.joint_types[joint] == 'prismatic']}"
    return f"{arm.joint_names[joint]} {amount} from optimum {twin} at {motion.time[row]:.3g} s"


def _branch(optimum: PlannedOptimum) -> str:
    return f"`{optimum.branch}`"  # as code, because Markdown would strike out text between tildes


def _further(count: int) -> list[str]:
    return [f"- and {count - DRAWING.optima} more"] if count > DRAWING.optima else []


def _value(scene: PlannedScene, value: float) -> str:
    return value_text(value, scene.unit, digits=5)


# The panel of a plan: the objective at all starts, their results and the optima, level by level.


ENTITY = "objective"
BEST = "best"  # name of the best point


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanPanel:
    """One band per level, with its starts in the order of the search, and one band of the final ``optima``.

    A band has width 1, and no mark touches its borders. Values beyond the axes are dashes at their edge.
    """

    scene: PlannedScene
    levels: Sequence[PlannedLevel]
    optima: Sequence[PlannedOptimum]

    def view(self) -> rrb.View:
        """Return the view."""
        return flat_view(ENTITY, "objective at starts", self.canvas.bounds())

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, borders between bands with the name of each below it, and the final optima, for all times."""
        canvas = self.canvas
        canvas.log(recording, ENTITY)
        recording.log(f"{ENTITY}/levels/lines", flat_lines(self._borders, SCREEN.frame, 0.7, 0.2), static=True)
        recording.log(f"{ENTITY}/final", flat_lines(self._value_lines, SCREEN.final, 0.7, 0.5), static=True)
        words = [f"{level.samples} samples" for level in self.levels] + ["optima"] * bool(self.optima)
        middles = canvas.place(np.array([(band + 0.5, canvas.low[1]) for band in range(len(words))]).reshape(-1, 2))
        title = np.array([[canvas.width / 2, canvas.height + 1.75 * TEXT.line]])
        places = np.concatenate([middles + np.array([0.0, 0.7 * TEXT.line]), title])
        names = labels([*words, "levels, each with its starts in the order of the search"], places)
        recording.log(f"{ENTITY}/levels/names", names, static=True)

    def log_until(
        self, recording: rr.RecordingStream, count: int, *, ended: bool = False, looked_at: int | None = None
    ) -> None:
        """Draw the first ``count`` starts with their results, and the level's best.

        ended: whether to draw the final optima too
        looked_at: number, from 1, of the start with the cursor, which labels avoid

        The best is that of the last start's level: values of other levels, with other samples, are not comparable.
        """
        across, starts, ends = self.across[:count], self.starts[:count], self.ends[:count]
        failed, borders = ~np.isfinite(ends), np.cumsum([0, *(len(level.starts) for level in self.levels)])
        first = int(borders[borders < count].max(initial=0))  # first start of the level of the last one
        for layer, rows, colour in (("starts", ~failed, SCREEN.population), ("failed", failed, SCREEN.failed)):
            # dots in the axes; those beyond are dashes that point towards them
            x, values, (low, high) = across[rows], starts[rows], (self.canvas.low[1], self.canvas.high[1])
            near, strips = self.is_near(values), list[np.ndarray]()
            self._log_points(recording, layer, x[near], values[near], colour, MARKS.start, 1.0)
            for at, value in zip(x[~near & np.isfinite(values)], values[~near & np.isfinite(values)], strict=True):
                tip, dash = np.array([at, np.clip(value, low, high)]), np.copysign(MARKS.edge_dash, value - high)
                strips.append(self.canvas.place(tip) + np.array([(0.0, 0.0), (0.0, dash)]))
            recording.log(f"{ENTITY}/{layer}/beyond", flat_lines(strips, colour, 0.8, 1.0))
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
            recording.log(f"{ENTITY}/cursor", flat_lines(cursors, SCREEN.text, 0.8, 0.8))

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
        """The horizontal places of all starts (starts,), each in the band of its level."""
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

    def is_near(self, values: Values) -> Mask:
        """Return which values the axes contain; others are drawn at the edge."""
        return np.asarray((values >= self.canvas.low[1]) & (values <= self.canvas.high[1]))

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
        at = self._mark(across, values)
        names = [name] if name and len(at) else None
        recording.log(f"{ENTITY}/{layer}", flat_dots(at, colour, radius, order, labels=names, show_labels=False))

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
        """Draw a point, or none, with its name."""
        self._log_points(recording, layer, across, values, colour, 6.5, order, words)
        canvas, marks, middles = self.canvas, self._mark(across, values), list[np.ndarray]()
        for mark in marks:
            others = np.concatenate([self._drawn, line_points(lines)])
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
        return np.concatenate([marks, line_points([*self._value_lines, *self._borders])])

    @property
    def _value_lines(self) -> list[np.ndarray]:
        """Lines [pixels] at the values of the final optima."""
        final = self._final[self.is_near(self._final)]
        return [self.canvas.place(np.array([(0.0, value), (self._end, value)])) for value in final]

    @property
    def _borders(self) -> list[np.ndarray]:
        """Lines [pixels] between bands."""
        return [self._upright(float(x)) for x in np.arange(1, int(self._end))]

    def _upright(self, x: float) -> np.ndarray:
        return self.canvas.place(np.array([(x, self.canvas.low[1]), (x, self.canvas.high[1])]))


START = "start"  # layer of a start's arm
DISTINCT = "distinct optima of the level so far"


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanDrawing:
    """The levels of a plan and its ``end`` (None before it); ``note``: what was left out.

    It has these timelines:

    - ``level``: the levels, then the final optima
    - ``start``: one start after another with its result
    - ``optimum``: one final optimum after another, if there are several
    - ``motion``: the motion of the best optimum
    - ``replay``: the motions of the best optimum of each level, one after another
    """

    scene: PlannedScene
    messages: Sequence[PlannedLevel]
    end: PlanEnd | None
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        motions = self._motions
        for drawn in (self._panel, motions, *self._charts):
            if drawn is not None:
                drawn.log(stream)
        for place, level in enumerate(self.messages):
            is_end = self.end is None and place == len(self.messages) - 1
            replay = float(self._clock.begins[place])
            set_times(stream, **self._end_times(level.number) if is_end else {"level": level.number, "replay": replay})
            self._panel.log_until(stream, self._lasts[place])
            log_text(stream, level_text(self._panel, level))
            numbers: dict[str, Any] = {name: getattr(level, name) for name in ("starts", "ends", "optima", "samples")}
            stream.log("search/level", rr.AnyValues(**numbers))
            self._log_cursors(stream, float(place))
            if motions is not None:
                motions.log_whole(stream, self._bests[place])
        if self.end is not None:  # the optima, at the end of all timelines
            last, count, nearest = self.messages[-1:], len(self._panel.starts), self.end.least_violating
            set_times(stream, **self._end_times(last[0].number + 1 if last else 0))
            self._panel.log_until(stream, count, ended=True)
            if nearest is None:
                words = plan_end_text(self.scene, self.end, self._lasts[0] if self._lasts else 0, count)
            else:
                units, cell = (self.scene.unit,), self.scene.workcell
                words = infeasible_text((self.scene.name,), units, nearest, cell, "No feasible motion")
            log_text(stream, words)
            if self.end.optima:
                values = [float(each.point.objectives[0]) for each in self.end.optima]
                stream.log("search/optima", rr.AnyValues(objective=values))
            self._log_cursors(stream, float(len(self.messages) - 1))
            if motions is not None:
                motions.log_whole(stream, self._best)
        if motions is not None:  # move the best arms, then show starts and optima one by one
            stream.reset_time()
            for point in self._best:
                motions.send_motion(stream, point)
            slots = [(float(self._clock.begins[place]), points) for place, points in enumerate(self._bests)]
            motions.send_replay(stream, [*slots, (self._clock.end, self._best)])
            for number, level, row, pair in self._walk:  # a start, and next to it its result
                set_times(stream, start=number)
                self._panel.log_until(stream, number, looked_at=number)
                log_text(stream, start_text(self.scene, level, row))
                self._log_cursors(stream, float(self._instants[number - 1]))
                motions.log_whole(stream, pair)
            optima = () if self.end is None or self._count < 2 else self.end.optima[: DRAWING.walk]
            for place, optimum in enumerate(optima):
                set_times(stream, optimum=place)
                self._panel.log_optimum(stream, place)
                if place:  # the first one has the text of all optima
                    log_text(stream, optimum_text(self.scene, optima, place, self._count))
                motions.log_whole(stream, [optimum.point])
        self._layout.log(stream)

    def _log_cursors(self, stream: rr.RecordingStream, instant: float) -> None:
        for chart in self._charts:
            chart.log_cursor(stream, instant)

    def _end_times(self, level: int) -> dict[str, float]:
        """Return the times of the end: a level, ``replay`` at its end, ``motion`` and ``optimum`` at 0."""
        return {"level": level, "replay": self._clock.end, "motion": 0.0} | ({"optimum": 0} if self._count > 1 else {})

    @cached_property
    def _panel(self) -> PlanPanel:
        optima = () if self.end is None else self.end.optima
        return PlanPanel(scene=self.scene, levels=self.messages, optima=optima)

    @cached_property
    def _lasts(self) -> list[int]:
        """The number of each level's last start."""
        return [int(last) for last in np.cumsum([len(level.starts) for level in self.messages])]

    @cached_property
    def _bests(self) -> list[tuple[RecordedPoint, ...]]:
        """The best optimum of each level as a point; empty for a level without optima."""
        return [
            tuple(_point(0, level.optima[0], level.motions.time, q) for q in level.motions.optima[:1])
            for level in self.messages
        ]

    @property
    def _best(self) -> tuple[RecordedPoint, ...]:
        """The plan's best optimum, else the least-violating motion, else the best of the last level."""
        nearest = None if self.end is None else self.end.least_violating
        if self.end is not None and self.end.optima:
            return (self.end.optima[0].point,)
        if nearest is not None and nearest.point is not None:
            return (nearest.point,)
        return self._bests[-1] if self._bests else ()

    @cached_property
    def _walk(self) -> list[tuple[int, PlannedLevel, int, tuple[RecordedPoint, RecordedPoint]]]:
        """Number, level and row of the starts shown one by one, and each start and its result as points."""
        rows = [(level, row) for level in self.messages for row in range(len(level.starts))]
        walk = []
        for place in even_rows(len(rows), DRAWING.starts).tolist():
            level, row = rows[place]
            motions = level.motions
            start = _point(row, level.starts[row], motions.time, motions.starts[row], axis=0)
            end = _point(row, level.ends[row], motions.time, motions.ends[row])  # drawn as chosen
            walk.append((place + 1, level, row, (start, end)))
        return walk

    @property
    def _count(self) -> int:
        return 0 if self.end is None else len(self.end.optima)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of(self._bests)

    @cached_property
    def _motions(self) -> MotionScene | None:
        """The arms; None if there is no motion yet."""
        optima = () if self.end is None else [each.point for each in self.end.optima[: DRAWING.walk]]
        points = [*optima, *self._best, *(point for points in self._bests for point in points)]
        if not points:
            return None
        others = [point for _, _, _, pair in self._walk for point in pair]
        return MotionScene(workcell=self.scene.workcell, names=(START,), points=[*points, *others], prefix="")

    @cached_property
    def _charts(self) -> list[Chart]:
        """The best and the number of distinct optima so far, over the starts of each level."""
        if not np.isfinite(self._panel.ends).any():
            return []
        best, distinct = np.full((2, len(self.messages), self._lasts[-1]), np.nan)  # NaN at other levels
        accumulate = np.fmax.accumulate if self.scene.maximised else np.fmin.accumulate
        for place, (level, last) in enumerate(zip(self.messages, self._lasts, strict=True)):
            columns, optimum = slice(last - len(level.starts), last), level.motions.optimum
            best[place, columns] = accumulate(np.where(np.isfinite(level.ends), level.ends, np.nan))
            first = [number >= 0 and number not in optimum[:row] for row, number in enumerate(optimum)]
            distinct[place, columns] = np.cumsum(first)
        label = screen_label(f"best {self.scene.name} of the level so far", self.scene.unit, self.scene.maximised)
        charts, colours = [], [SCREEN.joint(level.number) for level in self.messages]
        for name, title, words, curves in (
            ("best", "best of the level so far", label, best),
            ("distinct", "distinct optima", DISTINCT, distinct),
        ):
            shown = curve_points(self._instants, curves)
            edges = np.array([[at, np.nanmin(shown[:, 1])] for at in (-0.5, len(self.messages) - 0.5)])
            more = {"title": title, "names": [f"{level.samples} samples" for level in self.messages]}
            shown = np.concatenate([shown, edges])
            charts.append(Chart.over("level", name, words, self._instants, curves, colours, shown=shown, **more))
        return charts

    @property
    def _instants(self) -> np.ndarray:
        """Places of starts in charts: around the number of their level."""
        return self._panel.across - 0.5

    @property
    def _layout(self) -> Layout:
        motions, feasible = self._motions, self.end is None or self.end.least_violating is None
        entries = drawn_entries(
            ("start", SCREEN.population, True),
            ("start beyond the axes: a dash at their edge", SCREEN.population, True),
            ("result of a start", SCREEN.front, feasible),
            ("start that led to no optimum", SCREEN.failed, True),
            ("best of a level or of the plan", SCREEN.chosen, feasible),
            ("optimum looked at", SCREEN.arm, feasible and self._count > 1),  # a single optimum is the best
            ("values of the optima", SCREEN.final, feasible),
        )
        if motions is not None:
            entries += motions.entries("arm" if feasible else "arm of the least-violating motion")
            entries.append(("arm of the start looked at", SCREEN.end(0)))
        walked, count = len(self._walk), len(self._panel.starts)
        words = f"{walked} of {count} starts are shown one by one." if walked < count else ""
        return Layout(
            legend=Legend(entries=entries),
            front=self._panel.view(),
            charts=[chart.view() for chart in self._charts],
            texts=[text_view("level, start, optimum")],
            timeline="level",
            name="plan",
            frames=DRAWING.slow_frames,
            note=" ".join(filter(None, (self.note, words))),
            **motion_views(motions),
        )


def _point(place: int, value: float, time: np.ndarray, q: np.ndarray, axis: int | None = None) -> RecordedPoint:
    motion = RecordedMotion(time=time, q=q)
    return RecordedPoint(id=place, objectives=np.array([value]), axis=axis, motion=motion)
