"""The recording of a plan: its levels with their starts, and at the end its optima and their motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.curve_charts import Chart
from paretoik.review.drawing.infeasible_text import infeasible_text
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import plan_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.plan_panel import PlanPanel
from paretoik.review.drawing.plan_text import level_text, optimum_text, plan_end_text, start_text
from paretoik.review.drawing.recording_layout import TEXT, Layout, note_view, text_view
from paretoik.review.drawing.replay_clock import ReplayClock, replay_times
from paretoik.review.drawing.search_charts import DrawnChart
from paretoik.review.drawing_options import DRAWING
from paretoik.review.even_rows import even_rows
from paretoik.review.palette import SCREEN, screen_label
from paretoik.review.recording.planned import PlanEnd, PlannedLevel, PlannedScene
from paretoik.review.recording.recorded_point import RecordedMotion, RecordedPoint

START = "start"  # layer of a start's arm
DISTINCT = "distinct optima of the level so far"


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedPlan:
    """The levels of a plan and its ``end``, None where it has none yet.

    Timelines: ``level``, the last of which are the optima; ``start``, on which one start comes after the other with
    what it led to; ``optimum``, along the optima if there are several; ``motion``, along which the best moves;
    ``replay``, on which the best of each level moves in turn. ``note`` says what was left out.
    """

    scene: PlannedScene
    messages: Sequence[PlannedLevel]
    end: PlanEnd | None
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._layout.legend.log(stream)
        self._panel.log(stream)
        if self._motions is not None:
            self._motions.log(stream)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self._note:
            stream.log("notes/left_out", rr.TextDocument(self._note), static=True)
        for place, level in enumerate(self.messages):
            stream.reset_time()
            stream.set_time("level", sequence=level.number)
            stream.set_time("replay", duration=float(self._clock.begins[place]))
            if self.end is None and place == len(self.messages) - 1:
                self._at_the_end(stream)
            self._log_level(stream, place, level)
        if self.end is not None:
            self._log_end(stream, self.end)
        if self._motions is not None:
            self._send_motions(stream, self._motions)
            self._log_starts(stream, self._motions)
            self._log_optima(stream, self._motions)
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_level(self, stream: rr.RecordingStream, place: int, level: PlannedLevel) -> None:
        self._panel.log_until(stream, self._lasts[place])
        self._log_text(stream, level_text(self._panel, level))
        numbers: dict[str, Any] = {
            "starts": level.starts,
            "ends": level.ends,
            "optima": level.optima,
            "samples": level.samples,
        }
        stream.log("search/level", rr.AnyValues(**numbers))
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(place))
        if self._motions is not None:
            self._motions.log_whole(stream, self._bests[place])

    def _log_end(self, stream: rr.RecordingStream, end: PlanEnd) -> None:
        """Draw the optima, which stand at the end of all timelines."""
        stream.reset_time()
        stream.set_time("level", sequence=self._last_number)
        self._at_the_end(stream)
        count = len(self._panel.starts)
        self._panel.log_until(stream, count, ended=True)
        self._log_text(stream, self._end_text(end, count))
        if end.optima:
            stream.log(
                "search/optima", rr.AnyValues(objective=[float(each.point.objectives[0]) for each in end.optima])
            )
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(len(self.messages) - 1))
        if self._motions is not None:
            self._motions.log_whole(stream, self._best)

    def _end_text(self, end: PlanEnd, starts: int) -> str:
        """Return what is to be known of the end: its optima, or why there is none."""
        nearest, scene = end.least_violating, self.scene
        if nearest is None:
            return plan_end_text(scene, end, self._lasts[0] if self._lasts else 0, starts)
        return infeasible_text((scene.name,), (scene.unit,), nearest, scene.workcell, "No feasible motion")

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Let what follows stand at the end of ``replay``, and on ``motion`` and ``optimum``."""
        stream.set_time("replay", duration=self._clock.end)
        stream.set_time("motion", duration=0.0)
        if self._count > 1:
            stream.set_time("optimum", sequence=0)

    def _send_motions(self, stream: rr.RecordingStream, motions: MotionScene) -> None:
        """Let the best arm move: on ``motion`` that of the end, on ``replay`` that of every level in turn."""
        stream.reset_time()
        for point in self._best:
            motions.send_motion(stream, point)
        slots = [(float(self._clock.begins[place]), points) for place, points in enumerate(self._bests)]
        for begin, points in [*slots, (self._clock.end, self._best)]:
            for point in points:
                rows, times = replay_times(point, points, begin)
                motions.send(stream, point, [rr.TimeColumn("replay", duration=times)], rows)

    def _log_starts(self, stream: rr.RecordingStream, motions: MotionScene) -> None:
        """Show one start after the other: its motion, and beside it what it led to."""
        for number, level, row, points in self._walk:
            stream.reset_time()
            stream.set_time("start", sequence=number)
            self._panel.log_until(stream, number, looked_at=number)
            self._panel.log_start(stream, number)
            self._log_text(stream, start_text(self.scene, level, row))
            for chart, _, _ in self._charts:
                chart.log_cursor(stream, float(self._instants[number - 1]))
            motions.log_whole(stream, points)

    def _log_optima(self, stream: rr.RecordingStream, motions: MotionScene) -> None:
        """Walk along the optima."""
        optima = () if self.end is None or self._count < 2 else self.end.optima[: DRAWING.walk]
        for place, optimum in enumerate(optima):
            stream.reset_time()
            stream.set_time("optimum", sequence=place)
            self._panel.log_optimum(stream, place)
            if place:  # at the first all of them are told
                self._log_text(stream, optimum_text(self.scene, optima, place, self._count))
            motions.log_whole(stream, [optimum.point])

    def _log_text(self, stream: rr.RecordingStream, words: str) -> None:
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))

    @cached_property
    def _panel(self) -> PlanPanel:
        optima = () if self.end is None else self.end.optima
        return PlanPanel(scene=self.scene, levels=self.messages, optima=optima)

    @cached_property
    def _lasts(self) -> list[int]:
        """The number of each level's last start."""
        return [int(last) for last in np.cumsum([len(level.starts) for level in self.messages])]

    @property
    def _last_number(self) -> int:
        return self.messages[-1].number + 1 if self.messages else 0

    @cached_property
    def _bests(self) -> list[tuple[RecordedPoint, ...]]:
        """The best optimum of each level as a point, none where it has none."""
        return [
            tuple(_point(0, level.optima[0], level.motions.time, q) for q in level.motions.optima[:1])
            for level in self.messages
        ]

    @property
    def _best(self) -> tuple[RecordedPoint, ...]:
        """The best optimum of the plan, the least-violating motion where it has none, or the best of its last level."""
        nearest = None if self.end is None else self.end.least_violating
        if self.end is not None and self.end.optima:
            return (self.end.optima[0].point,)
        if nearest is not None and nearest.point is not None:
            return (nearest.point,)
        return self._bests[-1] if self._bests else ()

    @cached_property
    def _walk(self) -> list[tuple[int, PlannedLevel, int, tuple[RecordedPoint, RecordedPoint]]]:
        """Number, level and row of the starts that are shown one by one, each with what it led to as points."""
        rows = [(level, row) for level in self.messages for row in range(len(level.starts))]
        picked = even_rows(len(rows), DRAWING.starts).tolist()
        return [(place + 1, *rows[place], _start_and_end(*rows[place])) for place in picked]

    @property
    def _count(self) -> int:
        return 0 if self.end is None else len(self.end.optima)

    @property
    def _note(self) -> str:
        left_out = len(self._panel.starts) - len(self._walk)
        words = f"Of {len(self._panel.starts)} starts {len(self._walk)} are shown one by one." if left_out else ""
        return " ".join(filter(None, (self.note, words)))

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of(self._bests)

    @cached_property
    def _motions(self) -> MotionScene | None:
        """The arms; None where there is no motion yet."""
        optima = () if self.end is None else [each.point for each in self.end.optima[: DRAWING.walk]]
        points = [*optima, *self._best, *(point for points in self._bests for point in points)]
        if not points:
            return None
        others = [point for _, _, _, pair in self._walk for point in pair]
        return MotionScene(workcell=self.scene.workcell, names=(START,), points=[*points, *others], prefix="")

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        """The best so far, and how many distinct optima there are so far, over the starts of each level."""
        if not np.isfinite(self._panel.ends).any():
            return []
        label = screen_label(f"best {self.scene.name} of the level so far", self.scene.unit, self.scene.maximised)
        best = list(self._over_starts(_best_so_far(level, self.scene.maximised) for level in self.messages))
        distinct = list(self._over_starts(_distinct_so_far(level) for level in self.messages))
        return [
            self._chart("best", "best of the level so far", label, best),
            self._chart("distinct", "distinct optima", DISTINCT, distinct),
        ]

    def _over_starts(self, curves: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        """Yield the curve of each level over the starts of all levels, NaN at those of others."""
        for last, curve in zip(self._lasts, curves, strict=True):
            whole = np.full(self._lasts[-1], np.nan)
            whole[last - len(curve) : last] = curve
            yield whole

    @property
    def _instants(self) -> np.ndarray:
        """Where starts stand in charts: around the number of their level."""
        return self._panel.across - 0.5

    def _chart(self, name: str, title: str, label: str, curves: Sequence[np.ndarray]) -> DrawnChart:
        instants = self._instants
        shown = np.stack([np.tile(instants, len(curves)), np.concatenate(curves)], axis=1)
        edges = np.array([[-0.5, np.nanmin(shown[:, 1])], [len(self.messages) - 0.5, np.nanmin(shown[:, 1])]])
        chart = Chart(
            entity=f"charts/{name}",
            title=title,
            labels=("level", label),
            shown=np.concatenate([shown, edges]),
            names=[f"{level.samples} samples" for level in self.messages],
            colours=[SCREEN.joint(level.number) for level in self.messages],
        )
        return chart, instants, np.stack(curves)

    @cached_property
    def _layout(self) -> Layout:
        motions, feasible = self._motions, self.end is None or self.end.least_violating is None
        entries = plan_entries(motions, optima=self._count, feasible=feasible)
        notes: list[rrb.View] = [note_view()] if self._note else []
        return Layout(
            legend=Legend(entity="legend", entries=entries),
            front=self._panel.view(),
            charts=[chart.view() for chart, _, _ in self._charts],
            arm=None if motions is None else motions.view(),
            joints=[] if motions is None else [chart.view() for chart in motions.charts.values()],
            texts=[text_view("level, start, optimum"), *notes],
            timeline="level",
            name="plan",
            frames=DRAWING.slow_frames,
        )


def _point(place: int, value: float, time: np.ndarray, q: np.ndarray, axis: int | None = None) -> RecordedPoint:
    motion = RecordedMotion(time=time, q=q)
    return RecordedPoint(id=place, objectives=np.array([value]), axis=axis, motion=motion)


def _start_and_end(level: PlannedLevel, row: int) -> tuple[RecordedPoint, RecordedPoint]:
    """Return a start as a point beside the chosen one, and what it led to as that."""
    motions = level.motions
    start = _point(row, level.starts[row], motions.time, motions.starts[row], axis=0)
    return start, _point(row, level.ends[row], motions.time, motions.ends[row])


def _best_so_far(level: PlannedLevel, maximised: bool) -> np.ndarray:
    values = np.where(np.isfinite(level.ends), level.ends, -np.inf if maximised else np.inf)
    best = np.maximum.accumulate(values) if maximised else np.minimum.accumulate(values)
    return np.where(np.isfinite(best), best, np.nan)


def _distinct_so_far(level: PlannedLevel) -> np.ndarray:
    optimum = level.motions.optimum
    first = [number >= 0 and number not in optimum[:row] for row, number in enumerate(optimum)]
    return np.cumsum(first).astype(float)
