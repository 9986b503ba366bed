"""The recording of a search: generations as they come, then all on common axes, with motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int

from paretoik.arrays import Objectives
from paretoik.front.front import Front
from paretoik.front.indicators import HypervolumeCurve, HypervolumeOptions
from paretoik.review.drawing.charts import Chart
from paretoik.review.drawing.front_panels import replay_window
from paretoik.review.drawing.layout import TEXT_ENTITY as TEXT
from paretoik.review.drawing.layout import WHY, Layout, Legend, text_view
from paretoik.review.drawing.loop_drawing import LoopDrawing
from paretoik.review.drawing.motion import (
    CHOSEN,
    MotionScene,
    ReplayClock,
    has_motions,
    is_moving,
    posture_chart,
    replay_times,
)
from paretoik.review.drawing.point_text import (
    better_but_infeasible,
    choice_text,
    infeasible_text,
    point_text,
    reason_text,
    text_of,
)
from paretoik.review.drawing.scatter import search_scene
from paretoik.review.drawing.search_charts import (
    FrontViews,
    RecordedSearch,
    log_styles,
    search_entries,
    series_views,
)
from paretoik.review.palette import DRAWING, SCREEN, even_rows
from paretoik.review.recording.messages import LeastViolating, RecordedPoint, end_points, front_point
from paretoik.review.recording.recorder import Generation, RecorderOptions, SearchedFront, SearchEnd
from paretoik.search.maximin import greedy_order, scaled, starting_points

# The recording of a finished search: all generations on common axes, then the front and its motions.


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchDrawing:
    """A finished ``search``.

    Four timelines: that of its generations or levels; ``motion``, along which the last motions move, if they do;
    ``replay``, on which the motions of the generations follow each other; ``point``, which shows the points of the last
    front one by one, if it has several. All of them show the end.
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
        if self._end.front is not None and len(self._walk) > 1:  # a single point is visible anyway
            self._log_walk(stream, self._end.front)
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_still(self, stream: rr.RecordingStream) -> None:
        """Draw what does not change: axes, charts, the workcell, and the last front behind all others."""
        log_styles(self.search.scene, stream)
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
            self._postures.log(stream)
            if self._motions is not None:
                self._motions.log_postures(stream, self._postures.curves.T)

    def _log_generation(self, stream: rr.RecordingStream, generation: Generation, moved: int | None) -> None:
        end = "the final front" if self._nearest is None else "the last population"
        words = text_of(self.search.scene, generation, moved, outside=self._views.outside(generation), end=end)
        self._views.log_generation(stream, generation, words)
        if self._motions is not None:
            self._motions.log_whole(stream, generation.points)

    @cached_property
    def _moved(self) -> list[int | None]:
        """The generation whose motions are shown with each generation; itself if the points are the same."""
        moved, shown = list[int | None](), None
        for each in self._generations:
            shown = each if has_motions(each.points) else shown
            same = shown is not None and [point.id for point in shown.points] == [point.id for point in each.points]
            moved.append(each.number if same else None if shown is None else shown.number)
        return moved

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Set the time to the end, on all timelines."""
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
            self._postures.log_cursor(stream, float(self._end.choice.objectives[0]))

    def _log_words(self, stream: rr.RecordingStream, front: Front, words: str) -> None:
        """Show the text of a point, and the number of individuals behind the front that look better."""
        for last in self._generations[-1:]:
            words += f"\n\n{better_but_infeasible(self.search.scene, last.population, front.objectives)}"
        stream.log(TEXT, rr.TextDocument(words.rstrip(), media_type="text/markdown"))

    def _log_nearest(self, stream: rr.RecordingStream, nearest: LeastViolating) -> None:
        """Show what is broken if nothing is feasible, and the motion that breaks least."""
        self._at_the_end(stream)
        scene, canvases = self.search.scene, self._views.canvases
        words = infeasible_text(scene.names, scene.units, nearest, self.search.recorded.workcell, "No feasible point")
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        scene.log_marked(stream, self._end_points, canvases, avoided=self._drawn, taken=self._lines)
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)

    def _send_motions(self, stream: rr.RecordingStream) -> None:
        """Move arms: the final ones on ``motion``, those of every generation with motions on ``replay``."""
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
        """Show the points along the front one by one: the motion and text of each."""
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
                self._postures.log_cursor(stream, float(point.objectives[0]))

    @cached_property
    def _walk(self) -> list[RecordedPoint]:
        """Points along the last front, including the chosen one."""
        front, choice = self._end.front, self._end.choice
        if front is None or not len(front):
            return []
        rows = set(even_rows(len(front), DRAWING.walk).tolist())
        rows |= set() if choice is None else {choice.index}
        return [front_point(front, row) for row in sorted(rows)]

    @cached_property
    def _drawn(self) -> Objectives:
        """All drawn points of the end, and of the last generation behind it."""
        front = [] if self._end.front is None else [self._end.front.objectives]
        return np.concatenate([*front, *(each.population for each in self._generations[-1:])])

    @cached_property
    def _lines(self) -> Float[np.ndarray, "points 2"]:
        """Points [pixels] on the lines of the last generation, which are visible at the end."""
        last = self._generations[-1:]
        return self.search.scene.line_points(last[0], self._views.canvases) if last else np.zeros((0, 2))

    @property
    def _note(self) -> str:
        walked, whole = len(self._walk), 0 if self._end.front is None else len(self._end.front)
        words = f"{walked} of {whole} points are on the timeline point." if walked < whole else ""
        return " ".join(filter(None, (self.search.note, words)))

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The individually drawn points at the end: of the front, the least-violating, or the last generation's."""
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
        if fronts and len(fronts[-1]) and self.search.scene.timeline != "refinement":  # both fronts are looked at
            return replay_window(fronts)
        shown = np.concatenate([np.empty((0, len(self.search.scene.names))), *fronts])
        if len(shown):
            return shown
        return np.concatenate([shown, *(each.population for each in self._generations[-1:])])  # nothing is feasible

    @property
    def _generations(self) -> Sequence[Generation]:
        return self.search.generations

    @property
    def _end(self) -> SearchEnd:
        return self.search.end

    @property
    def _nearest(self) -> LeastViolating | None:
        """The least-violating point if nothing is feasible."""
        return self._end.least_violating

    @property
    def _chosen_words(self) -> str:
        """The name of the solid point at the end."""
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
    def _postures(self) -> Chart | None:
        """The joints along the front if arms stand still, since curves over time would be straight lines."""
        cell, front = self.search.recorded.workcell, self._end.front
        standing = all(point.motion is not None and point.motion.is_standing for point in self._end_points)
        if cell is None or front is None or not self._end_points or not standing or front.motions is None:
            return None
        postures = np.asarray(front.motions.q)[:, 0]
        return posture_chart(cell, front.objectives[:, 0], postures, self.search.scene.label(0))

    @cached_property
    def _layout(self) -> Layout:
        motions = self._motions
        joints: list[Chart] = [] if motions is None else list(motions.charts.values())
        if self._postures is not None:
            joints = [self._postures]
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


# Reduction of fronts with more points than a picture can show, and their hypervolume.


OPTIONS = HypervolumeOptions(share=0.25)
"""Share of the time: unlike the run, the recording process has time to spare."""


class FrontReduction:
    """Reduces generations of a search, whose objectives may be ``maximised``, to at most ``points`` points."""

    def __init__(self, *, maximised: tuple[bool, ...], points: int) -> None:
        self._signs = np.where(maximised, -1.0, 1.0)
        self._points = points
        self._hypervolume = HypervolumeCurve(OPTIONS)

    def reduce(self, generation: Generation) -> Generation:
        """Return a generation with points that MaxiMin spreads over its front, including the best of each objective."""
        volume, front = generation.hypervolume, generation.front
        if volume is None and generation.reference is not None:
            reference = generation.reference * self._signs
            volume = self._hypervolume.measure(front * self._signs, generation.number, reference)
        generation = replace(generation, hypervolume=volume, size=len(front))
        if len(front) <= self._points:
            return generation
        rows = spread_rows(front * self._signs, self._points)
        origins = None if generation.origins is None else generation.origins[rows]
        return replace(generation, front=front[rows], front_ids=generation.front_ids[rows], origins=origins)


def reduction_note(generations: Sequence[Generation]) -> str:
    """Return a note about what was left out of the fronts of generations, "" for nothing."""
    reduced = [len(each.front) for each in generations if each.size is not None and each.size > len(each.front)]
    if not reduced:
        return ""
    return f"At most {max(reduced)} points of an intermediate front are drawn, spread over it, with its ends."


def spread_rows(F: Objectives, count: int) -> Int[np.ndarray, " rows"]:
    """Return, in order, ``count`` rows of a minimised front: the best of each objective, then by MaxiMin.

    Marcos et al. (2012); see ``search.maximin``.
    """
    Z = scaled(F, F.min(axis=0), F.max(axis=0))
    starts = list(dict.fromkeys([*F.argmin(axis=0).tolist(), *starting_points(Z)]))[:count]
    order, _ = greedy_order(Z, count, np.full(len(Z), np.inf), starts)
    return np.asarray(np.sort(order))


# The recording of a search while it runs, and afterwards.


def search_drawing(
    scene: SearchedFront, messages: Sequence[Generation], end: SearchEnd | None, note: str
) -> SearchDrawing | LoopDrawing:
    """Return the drawing of a search, or of a closed loop; without an end the last generation is the end."""
    search = RecordedSearch(
        scene=search_scene(scene),
        recorded=scene,
        generations=messages,
        end=SearchEnd(front=None) if end is None else end,
        note=" ".join(filter(None, (note, reduction_note(messages)))),
    )
    return LoopDrawing(search=search) if scene.timeline == "step" else SearchDrawing(search=search)


class LiveSearch:
    """Draws a search or a closed loop while it runs; a generation that does not fit the axes gets new ones."""

    def __init__(self, scene: SearchedFront, stream: rr.RecordingStream, options: RecorderOptions) -> None:
        self._search = RecordedSearch(
            scene=search_scene(scene), recorded=scene, generations=(), end=SearchEnd(front=None)
        )
        self._stream = stream
        self._reduction = FrontReduction(maximised=scene.maximised, points=options.points)
        self._views: FrontViews | None = None
        self._motions: MotionScene | None = None
        log_styles(self._search.scene, stream)

    def reduce(self, generation: Generation) -> Generation:
        """Return a generation with at most as many points as are drawn, and its hypervolume."""
        return self._reduction.reduce(generation)

    def record(self, generation: Generation) -> None:
        """Draw a generation."""
        stream, scene, points = self._stream, self._search.scene, generation.points
        stream.set_time(scene.timeline, sequence=generation.number)
        shown = generation.front if len(generation.front) else generation.population
        views, motions = self._views, self._motions
        if views is None or not scene.fits(views.canvases, shown):
            views = FrontViews(search=self._search, shown=shown, note="")
            views.log(stream, static=False)
        if motions is None and (cell := self._search.recorded.workcell) is not None and has_motions(points):
            motions = MotionScene(workcell=cell, names=scene.names, points=points)
            motions.log(stream)
        if self._views is None or not self._views.canvases or motions is not self._motions:  # there is more to see
            layout = Layout(
                legend=Legend(entity="legend", entries=search_entries(scene, motions)),
                front=views.front,
                charts=[*views.charts, *series_views(scene)],
                arm=None if motions is None else motions.view(),
                joints=[] if motions is None else [chart.view() for chart in motions.charts.values()],
                texts=[text_view(scene.timeline)],
                timeline=scene.timeline,
            )
            layout.legend.log(stream)
            stream.send_blueprint(layout.blueprint())
        self._views, self._motions = views, motions
        views.log_generation(stream, generation, text_of(scene, generation))
        if motions is not None:
            motions.log_whole(stream, points)
