"""The recording of a search that is over: all generations on common axes, at their end the front and its motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.front.front import Front
from paretoik.review.drawing.curve_charts import Chart
from paretoik.review.drawing.front_panels import replay_window
from paretoik.review.drawing.front_views import FrontViews, RecordedSearch
from paretoik.review.drawing.infeasible_text import infeasible_text
from paretoik.review.drawing.joint_charts import posture_chart
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import CHOSEN, MotionScene
from paretoik.review.drawing.point_text import better_but_infeasible, choice_text, point_text, reason_text, text_of
from paretoik.review.drawing.recording_layout import TEXT, WHY, Layout, text_view
from paretoik.review.drawing.replay_clock import ReplayClock, has_motions, is_moving, replay_times
from paretoik.review.drawing.search_charts import DrawnChart
from paretoik.review.drawing_options import DRAWING
from paretoik.review.even_rows import even_rows
from paretoik.review.palette import SCREEN
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.recorded_end import end_points, front_point
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Generation, SearchEnd


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedSearch:
    """A ``search`` that is over.

    Four timelines: that of its generations or levels; ``motion``, along which the last motions move, if they do;
    ``replay``, on which the motions of one generation come after those of the other; ``point``, which walks along the
    last front, if it has several. What is seen at the end stands on all of them.
    """

    search: RecordedSearch

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._log_still(stream)
        for place, generation in enumerate(self._generations):
            stream.reset_time()
            stream.set_time(self.search.scene.timeline, sequence=generation.number)
            stream.set_time("replay", duration=float(self._clock.begins[place]))
            if place == len(self._generations) - 1:
                self._at_the_end(stream)
            self._log_generation(stream, generation, self._moved[place])
        if self._end.front is not None:
            self._log_front(stream, self._end.front)
        if self._nearest is not None:
            self._log_nearest(stream, self._nearest)
        stream.reset_time()
        self._send_motions(stream)
        if self._end.front is not None and len(self._walk) > 1:  # one point alone is seen anyway
            self._log_walk(stream, self._end.front)
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_still(self, stream: rr.RecordingStream) -> None:
        """Draw what does not change: axes, charts, the workcell, the last front behind all others."""
        self._views.log(stream)
        self._layout.legend.log(stream)
        if self._end.front is not None:
            final = self._end.front.objectives
            self.search.scene.log_points(stream, "final", final, self._views.canvases, static=True)
            if self._views.parallel is not None:
                lines = self._views.parallel.lines(final, SCREEN.final, 0.6, 0.5)
                stream.log(f"{self._views.parallel.entity}/final", lines, static=True)
        if self._end.choice is not None:
            stream.log(WHY, rr.TextDocument(reason_text(self._end.choice), media_type="text/markdown"), static=True)
        if self._motions is not None:
            self._motions.log(stream)
        if self._postures is not None:
            chart, instants, curves = self._postures
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self._postures is not None and self._motions is not None:
            self._motions.log_postures(stream, self._postures[2].T)

    def _log_generation(self, stream: rr.RecordingStream, generation: Generation, moved: int | None) -> None:
        end = "the final front" if self._nearest is None else "the last population"
        words = text_of(self.search.scene, generation, moved, outside=self._views.outside(generation), end=end)
        self._views.log_generation(stream, generation, words)
        if self._motions is not None:
            self._motions.log_whole(stream, generation.points)

    @cached_property
    def _moved(self) -> list[int | None]:
        """The generation whose motions are shown with each: itself where it has the points of these."""
        moved, shown = list[int | None](), None
        for each in self._generations:
            shown = each if has_motions(each.points) else shown
            same = shown is not None and [point.id for point in shown.points] == [point.id for point in each.points]
            moved.append(each.number if same else None if shown is None else shown.number)
        return moved

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Let what follows stand at the end, on all timelines."""
        last = self._generations[-1].number if self._generations else 0
        stream.set_time(self.search.scene.timeline, sequence=last)
        stream.set_time("replay", duration=self._clock.end)
        if is_moving(self._end_points):
            stream.set_time("motion", duration=0.0)
        if len(self._walk) > 1:
            stream.set_time("point", sequence=0)

    def _log_front(self, stream: rr.RecordingStream, front: Front) -> None:
        """Draw the last front with its choice and their motions."""
        self._at_the_end(stream)
        scene, points, canvases = self.search.scene, self._end_points, self._views.canvases
        scene.log_points(stream, "front", front.objectives, canvases, ids=front.ids, named=True)
        scene.log_marked(stream, points, canvases, avoided=self._drawn, taken=self._lines)
        if self._views.parallel is not None:
            chosen = None if self._end.choice is None else self._end.choice.objectives
            scene.log_lines(stream, self._views.parallel, front.objectives, chosen)
        if self._end.choice is not None:
            self._log_words(stream, front, choice_text(front, self._end.choice, whole=False))
        if self._motions is not None:
            self._motions.log_whole(stream, points)
        if self._postures is not None and self._end.choice is not None:
            self._postures[0].log_cursor(stream, float(self._end.choice.objectives[0]))

    def _log_words(self, stream: rr.RecordingStream, front: Front, words: str) -> None:
        """Say what is to be known of a point, and of the individuals behind the front that look better than it."""
        for last in self._generations[-1:]:
            words += f"\n\n{better_but_infeasible(self.search.scene, last.population, front.objectives)}"
        stream.log(TEXT, rr.TextDocument(words.rstrip(), media_type="text/markdown"))

    def _log_nearest(self, stream: rr.RecordingStream, nearest: LeastViolating) -> None:
        """Say what is broken where nothing is feasible, and show the motion that breaks least."""
        self._at_the_end(stream)
        scene, canvases = self.search.scene, self._views.canvases
        words = infeasible_text(scene.names, scene.units, nearest, self.search.recorded.workcell, "No feasible point")
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        scene.log_marked(stream, self._end_points, canvases, avoided=self._drawn, taken=self._lines)
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)

    def _send_motions(self, stream: rr.RecordingStream) -> None:
        """Let arms move: on ``motion`` those of the end, on ``replay`` those of every generation that has some."""
        if self._motions is None:
            return
        for point in self._end_points:
            self._motions.send_motion(stream, point)
        slots = [(float(self._clock.begins[i]), self._generations[i].points) for i in sorted(self._clock.moving)]
        if is_moving(self._end_points):
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
            self.search.scene.log_looked_at(
                stream,
                point,
                self._views.canvases,
                self._views.parallel,
                avoided=self._drawn,
                marked=self._end_points,
                taken=self._lines,
            )
            row = int(np.flatnonzero(front.ids == point.id)[0])
            self._log_words(stream, front, point_text(front, row, chosen=self._end.choice))
            if self._motions is not None:
                self._motions.log_whole(stream, [point])
            if self._postures is not None:
                self._postures[0].log_cursor(stream, float(point.objectives[0]))

    @cached_property
    def _walk(self) -> list[RecordedPoint]:
        """Points along the last front, the chosen one among them."""
        front, choice = self._end.front, self._end.choice
        if front is None or not len(front):
            return []
        rows = set(even_rows(len(front), DRAWING.walk).tolist())
        rows |= set() if choice is None else {choice.index}
        return [front_point(front, row) for row in sorted(rows)]

    @cached_property
    def _drawn(self) -> Objectives:
        """What is drawn of the end, and of the last generation behind it."""
        front = [] if self._end.front is None else [self._end.front.objectives]
        return np.concatenate([*front, *(each.population for each in self._generations[-1:])])

    @cached_property
    def _lines(self) -> Float[np.ndarray, "points 2"]:
        """Points [pixels] on the lines of the last generation, which stand at the end."""
        last = self._generations[-1:]
        return self.search.scene.line_points(last[0], self._views.canvases) if last else np.zeros((0, 2))

    @property
    def _note(self) -> str:
        walked, whole = len(self._walk), 0 if self._end.front is None else len(self._end.front)
        words = f"Of {whole} points {walked} are on the timeline point." if walked < whole else ""
        return " ".join(filter(None, (self.search.note, words)))

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The points drawn for themselves at the end: of the front, the least-violating, or the last generation's."""
        if self._end.front is not None:
            return end_points(self._end.front, self._end.choice)
        if self._nearest is not None:
            return () if self._nearest.point is None else (self._nearest.point,)
        with_motions = [each.points for each in self._generations if has_motions(each.points)]
        return with_motions[-1] if with_motions else ()

    @cached_property
    def _shown(self) -> Objectives:
        fronts = [each.front for each in self._generations]
        fronts += [] if self._end.front is None else [self._end.front.objectives]
        if fronts and len(fronts[-1]) and self.search.scene.timeline != "refinement":  # of which both are looked at
            return replay_window(fronts)
        shown = np.concatenate([np.empty((0, len(self.search.scene.names))), *fronts])
        if len(shown):
            return shown
        return np.concatenate([shown, *(each.population for each in self._generations[-1:])])  # none is feasible

    @property
    def _generations(self) -> Sequence[Generation]:
        return self.search.generations

    @property
    def _end(self) -> SearchEnd:
        return self.search.end

    @property
    def _nearest(self) -> LeastViolating | None:
        """What comes nearest to being feasible, where nothing is."""
        return self._end.least_violating

    @property
    def _chosen_words(self) -> str:
        """What the point is that is drawn solid at the end."""
        if self._nearest is not None:
            return "least-violating"
        return CHOSEN if self._end.front is not None and self._end.choice is not None else "compromise"

    @cached_property
    def _views(self) -> FrontViews:
        return FrontViews(search=self.search, shown=self._shown, note=self._note)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of([each.points for each in self._generations])

    @cached_property
    def _motions(self) -> MotionScene | None:
        cell = self.search.recorded.workcell
        points = [*self._walk, *self._end_points, *(point for each in self._generations for point in each.points)]
        if cell is None or not any(point.motion is not None and point.axis is None for point in points):
            return None
        return MotionScene(workcell=cell, names=self.search.scene.names, points=points)

    @cached_property
    def _postures(self) -> DrawnChart | None:
        """The joints along the front, where arms stand still and would show straight lines over time."""
        cell, front = self.search.recorded.workcell, self._end.front
        standing = all(point.motion is not None and point.motion.is_standing for point in self._end_points)
        if cell is None or front is None or not self._end_points or not standing or front.motions is None:
            return None
        postures = np.asarray(front.motions.q)[:, 0]
        chart, values, curves = posture_chart(cell, front.objectives[:, 0], postures, self.search.scene.label(0))
        return replace(chart, title="joint position over the final front"), values, curves

    @cached_property
    def _layout(self) -> Layout:
        motions = self._motions
        joints: list[Chart] = [] if motions is None else list(motions.charts.values())
        if self._postures is not None:
            joints = [self._postures[0]]
        scene, choice = self.search.scene, self._end.choice
        chosen = "compromise" if self._nearest is None else self._chosen_words
        why = [] if choice is None else [rrb.TextDocumentView(origin=WHY, name="why")]
        postures = "" if self._postures is None else "postures of the final front"
        entries = search_entries(scene, motions, chosen=chosen, walked=len(self._walk) > 1, postures=postures)
        return Layout(
            legend=Legend(entity="legend", entries=entries),
            front=self._views.front,
            charts=self._views.charts,
            arm=None if motions is None else motions.view(),
            joints=[chart.view() for chart in joints],
            texts=[text_view(f"{scene.timeline}, {self._chosen_words}"), *why, *self._views.notes],
            timeline=scene.timeline,
        )
