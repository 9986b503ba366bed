"""The recording of a search that is over: all generations on common axes, at their end the front and its motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Objectives
from paretoik.front.front import Front
from paretoik.review.drawing.curve_charts import Chart
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.joint_charts import posture_chart
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import CHOSEN, MotionScene
from paretoik.review.drawing.parallel_axes import ParallelAxes
from paretoik.review.drawing.point_text import choice_text, point_text, text_of
from paretoik.review.drawing.recording_layout import TEXT, Layout, note_view, text_view
from paretoik.review.drawing.replay_clock import ReplayClock, has_motions, replay_times
from paretoik.review.drawing.search_charts import DrawnChart, log_series, search_charts
from paretoik.review.drawing.search_scene import SearchScene, replay_window
from paretoik.review.drawing_options import DRAWING
from paretoik.review.even_rows import even_rows
from paretoik.review.recording.recorded_end import end_points, front_point
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedSearch:
    """All ``generations`` of a search and its ``end``.

    Four timelines: the scene's own, ``generation`` for one; ``motion``, along which the last motions move; ``replay``,
    on which the motions of one generation come after those of the other; ``point``, which walks along the last front.
    What is seen at the end stands on all of them. ``note`` says what was left out.
    """

    scene: SearchScene
    recorded: SearchedFront
    generations: Sequence[Generation]
    end: SearchEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._log_still(stream)
        for place, generation in enumerate(self.generations):
            stream.reset_time()
            stream.set_time(self.scene.timeline, sequence=generation.number)
            stream.set_time("replay", duration=float(self._clock.begins[place]))
            if place == len(self.generations) - 1:
                self._at_the_end(stream)
            self._log_generation(stream, generation, self._moved[place])
        if self.end.front is not None:
            self._log_front(stream, self.end.front)
        stream.reset_time()
        self._send_motions(stream)
        if self.end.front is not None and len(self.end.front):
            self._log_walk(stream, self.end.front)
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_still(self, stream: rr.RecordingStream) -> None:
        """Draw what does not change: axes, charts, the workcell, the last front behind all others."""
        scene, canvases = self.scene, self._canvases
        scene.log_axes(stream, canvases, static=True)
        self._layout.legend.log(stream)
        if self.end.front is not None:
            scene.log_points(stream, "final", self.end.front.objectives, canvases, static=True)
        if self._parallel is not None:
            self._parallel.log(stream, static=True)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self._motions is not None:
            self._motions.log(stream)
        if self._postures is not None:
            chart, instants, curves = self._postures
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self._postures is not None and self._motions is not None:
            self._motions.log_postures(stream, self._postures[2].T)
        if self._note:
            stream.log("notes/left_out", rr.TextDocument(self._note), static=True)

    def _log_generation(self, stream: rr.RecordingStream, generation: Generation, moved: int | None) -> None:
        self.scene.log_generation(stream, generation, self._canvases, self._parallel)
        log_series(self.scene, stream, generation)
        stream.log(TEXT, rr.TextDocument(text_of(self.scene, generation, moved), media_type="text/markdown"))
        if self._motions is not None:
            self._motions.log_whole(stream, generation.points)
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(generation.number))

    @cached_property
    def _moved(self) -> list[int | None]:
        """The generation whose motions are shown with each: itself where it has the points of these."""
        moved, shown = list[int | None](), None
        for each in self.generations:
            shown = each if has_motions(each.points) else shown
            same = shown is not None and [point.id for point in shown.points] == [point.id for point in each.points]
            moved.append(each.number if same else None if shown is None else shown.number)
        return moved

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Let what follows stand at the end, on all timelines."""
        last = self.generations[-1].number if self.generations else 0
        stream.set_time(self.scene.timeline, sequence=last)
        stream.set_time("replay", duration=self._clock.end)
        stream.set_time("motion", duration=0.0)
        stream.set_time("point", sequence=0)

    def _log_front(self, stream: rr.RecordingStream, front: Front) -> None:
        """Draw the last front with its choice and their motions."""
        self._at_the_end(stream)
        scene, points = self.scene, self._end_points
        scene.log_points(stream, "front", front.objectives, self._canvases, ids=front.ids, named=True)
        scene.log_marked(stream, points, self._canvases, avoided=front.objectives)
        if self._parallel is not None:
            chosen = None if self.end.choice is None else self.end.choice.objectives
            scene.log_lines(stream, self._parallel, front.objectives, chosen)
        if self.end.choice is not None:
            words = choice_text(front, self.end.choice)
            stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        if self._motions is not None:
            self._motions.log_whole(stream, points)
        if self._postures is not None and self.end.choice is not None:
            self._postures[0].log_cursor(stream, float(self.end.choice.objectives[0]))

    def _send_motions(self, stream: rr.RecordingStream) -> None:
        """Let arms move: on ``motion`` those of the end, on ``replay`` those of every generation that has some."""
        if self._motions is None:
            return
        for point in self._end_points:
            if point.motion is not None:
                times = point.motion.time - point.motion.time[0]
                columns = [rr.TimeColumn("motion", duration=times)]
                self._motions.send(stream, point, columns)
                if point.axis is None:
                    self._motions.send_series(stream, point, columns)
        slots = [(float(self._clock.begins[i]), self.generations[i].points) for i in sorted(self._clock.moving)]
        if has_motions(self._end_points):
            slots.append((self._clock.end, self._end_points))
        for begin, points in slots:
            for point in points:
                if point.motion is not None:
                    rows, times = replay_times(point, points, begin)
                    self._motions.send(stream, point, [rr.TimeColumn("replay", duration=times)], rows)

    def _log_walk(self, stream: rr.RecordingStream, front: Front) -> None:
        """Walk along the front: at every point its motion, and what is known of it."""
        for number, point in enumerate(self._walk):
            stream.reset_time()
            stream.set_time("point", sequence=number)
            named, F = self.end.choice is None or point.id != self.end.choice.id, front.objectives
            self.scene.log_looked_at(stream, point, self._canvases, self._parallel, avoided=F, named=named)
            words = point_text(front, int(np.flatnonzero(front.ids == point.id)[0]), chosen=self.end.choice)
            stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
            if self._motions is not None:
                self._motions.log_whole(stream, [point])
            if self._postures is not None:
                self._postures[0].log_cursor(stream, float(point.objectives[0]))

    @cached_property
    def _walk(self) -> list[RecordedPoint]:
        """Points along the last front, the chosen one among them."""
        front, choice = self.end.front, self.end.choice
        if front is None or not len(front):
            return []
        rows = set(even_rows(len(front), DRAWING.walk).tolist())
        rows |= set() if choice is None else {choice.index}
        return [front_point(front, row) for row in sorted(rows)]

    @property
    def _note(self) -> str:
        walked, whole = len(self._walk), 0 if self.end.front is None else len(self.end.front)
        words = f"Of {whole} points {walked} are on the timeline point." if walked < whole else ""
        return " ".join(filter(None, (self.note, words)))

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The points drawn for themselves at the end: of the front, or where there is none of the last generation."""
        if self.end.front is not None:
            return end_points(self.end.front, self.end.choice)
        with_motions = [each.points for each in self.generations if has_motions(each.points)]
        return with_motions[-1] if with_motions else ()

    @cached_property
    def _shown(self) -> Objectives:
        fronts = [each.front for each in self.generations]
        fronts += [] if self.end.front is None else [self.end.front.objectives]
        if fronts and len(fronts[-1]) and self.scene.timeline != "refinement":  # of which both are looked at
            return replay_window(fronts)
        return np.concatenate([np.empty((0, len(self.scene.names))), *fronts])

    @cached_property
    def _canvases(self) -> list[Canvas]:
        return self.scene.canvases(self._shown)

    @cached_property
    def _parallel(self) -> ParallelAxes | None:
        return self.scene.parallel_axes(self._shown)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of([each.points for each in self.generations])

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        return search_charts(self.scene, self.generations)

    @cached_property
    def _motions(self) -> MotionScene | None:
        cell = self.recorded.workcell
        points = [*self._walk, *self._end_points, *(point for each in self.generations for point in each.points)]
        if cell is None or not any(point.motion is not None and point.axis is None for point in points):
            return None
        return MotionScene(workcell=cell, names=self.scene.names, points=points)

    @cached_property
    def _postures(self) -> DrawnChart | None:
        """The joints along the front, where arms stand still and would show straight lines over time."""
        cell, front = self.recorded.workcell, self.end.front
        standing = all(point.motion is not None and point.motion.is_standing for point in self._end_points)
        if cell is None or front is None or not self._end_points or not standing or front.motions is None:
            return None
        postures = np.asarray(front.motions.q)[:, 0]
        chart, values, curves = posture_chart(cell, front.objectives[:, 0], postures, self.scene.label(0))
        return replace(chart, title="joint position over the final front"), values, curves

    @cached_property
    def _layout(self) -> Layout:
        motions = self._motions
        joints: list[Chart] = [] if motions is None else list(motions.charts.values())
        if self._postures is not None:
            joints = [self._postures[0]]
        parallel = [] if self._parallel is None else [self._parallel.view()]
        notes: list[rrb.View] = [note_view()] if self._note else []
        words = CHOSEN if self.end.front is not None and self.end.choice is not None else "compromise"
        return Layout(
            legend=Legend(entity="legend", entries=search_entries(self.scene, motions, walked=bool(self._walk))),
            front=self.scene.view() if self._canvases else None,
            charts=[*parallel, *(chart.view() for chart, _, _ in self._charts)],
            arm=None if motions is None else motions.view(),
            joints=[chart.view() for chart in joints],
            texts=[text_view(f"{self.scene.timeline}, {words}"), *notes],
            timeline=self.scene.timeline,
        )
