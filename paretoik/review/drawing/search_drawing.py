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
from paretoik.review.drawing.layout import Layout, Legend, log_text, text_view
from paretoik.review.drawing.loop_drawing import LoopDrawing
from paretoik.review.drawing.motion import (
    CHOSEN,
    MotionScene,
    ReplayClock,
    has_motions,
    is_moving,
    motion_views,
    posture_chart,
)
from paretoik.review.drawing.point_text import (
    better_but_infeasible,
    choice_text,
    infeasible_text,
    point_text,
    reason_text,
    text_of,
)
from paretoik.review.drawing.scatter import Scatter, SearchScene, search_scene
from paretoik.review.drawing.search_charts import FrontViews, log_styles, search_entries, series_views
from paretoik.review.palette import DRAWING, SCREEN, even_rows
from paretoik.review.recording.messages import LeastViolating, RecordedPoint, Workcell, end_points, front_point
from paretoik.review.recording.recorder import Generation, RecorderOptions, SearchedFront, SearchEnd
from paretoik.search.maximin import greedy_order, scaled, starting_points

# The recording of a finished search: all generations on common axes, then the front and its motions.


WHY = "notes/why"  # entity of the reason of the choice


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchDrawing:
    """A finished search, whose motions are in the workcell ``cell``; ``note``: what was left out.

    Four timelines: that of its generations or levels; ``motion``, along which the last motions move, if they do;
    ``replay``, on which the motions of the generations follow each other; ``point``, which shows the points of the last
    front one by one, if it has several. All of them show the end.
    """

    scene: SearchScene
    cell: Workcell | None
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
            end = "the final front" if self._nearest is None else "the last population"
            outside, moved = self._scatter.outside(generation.population), self._moved[place]
            words = text_of(self.scene, generation, moved, outside=outside, end=end)
            self._views.log_generation(stream, generation, words)
            if self._motions is not None:
                self._motions.log_whole(stream, generation.points)
        stream.reset_time()
        self._at_the_end(stream)
        if self.end.front is not None:
            self._log_front(stream, self.end.front)
        if self._nearest is not None:
            self._log_nearest(stream, self._nearest)
        stream.reset_time()
        self._send_motions(stream)
        if self.end.front is not None and len(self._walk) > 1:  # a single point is visible anyway
            self._log_walk(stream, self.end.front)
        stream.reset_time()
        self._layout.log(stream)

    def _log_still(self, stream: rr.RecordingStream) -> None:
        """Draw what does not change: axes, charts, the workcell, and the last front behind all others."""
        log_styles(self.scene, stream)
        self._views.log(stream)
        if self.end.front is not None:
            final, parallel = self.end.front.objectives, self._scatter.parallel
            self._scatter.log_points(stream, "final", final, static=True)
            if parallel is not None:
                stream.log(f"{parallel.entity}/final", parallel.lines(final, SCREEN.final, 0.6, 0.5), static=True)
        if self.end.choice is not None:
            log_text(stream, reason_text(self.end.choice), WHY, static=True)
        if self._motions is not None:
            self._motions.log(stream)
        if self._postures is not None:
            self._postures.log(stream)
            if self._motions is not None:
                self._motions.log_postures(stream, self._postures.curves.T)

    @cached_property
    def _moved(self) -> list[int | None]:
        """The generation whose motions are shown with each generation; itself if the points are the same."""
        moved, shown = list[int | None](), None
        for each in self.generations:
            shown = each if has_motions(each.points) else shown
            same = shown is not None and [point.id for point in shown.points] == [point.id for point in each.points]
            moved.append(each.number if same else None if shown is None else shown.number)
        return moved

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Set the time to the end, on all timelines."""
        last = self.generations[-1].number if self.generations else 0
        stream.set_time(self.scene.timeline, sequence=last)
        stream.set_time("replay", duration=self._clock.end)
        if is_moving(self._end_points):
            stream.set_time("motion", duration=0.0)
        if len(self._walk) > 1:
            stream.set_time("point", sequence=0)

    def _log_front(self, stream: rr.RecordingStream, front: Front) -> None:
        """Draw the last front with its choice and their motions."""
        scatter, choice = self._scatter, self.end.choice
        names = [f"point {number}" for number in front.ids]
        scatter.log_points(stream, "front", front.objectives, ids=front.ids, names=names)
        scatter.log_marked(stream, self._end_points, avoided=self._drawn, taken=self._lines)
        scatter.log_lines(stream, front.objectives, None if choice is None else choice.objectives)
        if choice is not None:
            self._log_words(stream, front, choice_text(front, choice, whole=False))
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)
        if self._postures is not None and choice is not None:
            self._postures.log_cursor(stream, float(choice.objectives[0]))

    def _log_words(self, stream: rr.RecordingStream, front: Front, words: str) -> None:
        """Show the text of a point, and the number of individuals behind the front that look better."""
        for last in self.generations[-1:]:
            words += f"\n\n{better_but_infeasible(self.scene, last.population, front.objectives)}"
        log_text(stream, words.rstrip())

    def _log_nearest(self, stream: rr.RecordingStream, nearest: LeastViolating) -> None:
        """Show what is broken if nothing is feasible, and the motion that breaks least."""
        words = infeasible_text(self.scene.names, self.scene.units, nearest, self.cell, "No feasible point")
        log_text(stream, words)
        self._scatter.log_marked(stream, self._end_points, avoided=self._drawn, taken=self._lines)
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)

    def _send_motions(self, stream: rr.RecordingStream) -> None:
        """Move arms: the final ones on ``motion``, those of every generation with motions on ``replay``."""
        if self._motions is None:
            return
        for point in self._end_points:
            self._motions.send_motion(stream, point)
        slots = [(float(self._clock.begins[i]), self.generations[i].points) for i in sorted(self._clock.moving)]
        if is_moving(self._end_points):
            slots.append((self._clock.end, self._end_points))
        self._motions.send_replay(stream, slots)

    def _log_walk(self, stream: rr.RecordingStream, front: Front) -> None:
        """Show the points along the front one by one: the motion and text of each."""
        rows = {int(number): row for row, number in enumerate(front.ids)}
        for number, point in enumerate(self._walk):
            stream.reset_time()
            stream.set_time("point", sequence=number)
            marked, lines = self._end_points, self._lines
            self._scatter.log_looked_at(stream, point, avoided=self._drawn, marked=marked, taken=lines)
            self._log_words(stream, front, point_text(front, rows[point.id], chosen=self.end.choice))
            if self._motions is not None:
                self._motions.log_whole(stream, [point])
            if self._postures is not None:
                self._postures.log_cursor(stream, float(point.objectives[0]))

    @cached_property
    def _walk(self) -> list[RecordedPoint]:
        """Points along the last front, including the chosen one."""
        front, choice = self.end.front, self.end.choice
        if front is None or not len(front):
            return []
        rows = set(even_rows(len(front), DRAWING.walk).tolist())
        rows |= set() if choice is None else {choice.index}
        return [front_point(front, row) for row in sorted(rows)]

    @cached_property
    def _drawn(self) -> Objectives:
        """All drawn points of the end, and of the last generation behind it."""
        front = [] if self.end.front is None else [self.end.front.objectives]
        return np.concatenate([*front, *(each.population for each in self.generations[-1:])])

    @cached_property
    def _lines(self) -> Float[np.ndarray, "points 2"]:
        """Points [pixels] on the lines of the last generation, which are visible at the end."""
        return self._scatter.line_points(self.generations[-1]) if self.generations else np.zeros((0, 2))

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The individually drawn points at the end: of the front, the least-violating, or the last generation's."""
        if self.end.front is not None:
            return end_points(self.end.front, self.end.choice)
        if self._nearest is not None:
            return () if self._nearest.point is None else (self._nearest.point,)
        with_motions = [each.points for each in self.generations if has_motions(each.points)]
        return with_motions[-1] if with_motions else ()

    @property
    def _nearest(self) -> LeastViolating | None:
        """The least-violating point if nothing is feasible."""
        return self.end.least_violating

    @cached_property
    def _scatter(self) -> Scatter:
        fronts = [each.front for each in self.generations]
        fronts += [] if self.end.front is None else [self.end.front.objectives]
        if fronts and len(fronts[-1]) and self.scene.timeline != "refinement":  # both of its fronts are looked at
            return Scatter(scene=self.scene, shown=replay_window(fronts))
        shown = np.concatenate([np.empty((0, len(self.scene.names))), *fronts])
        if not len(shown):  # nothing is feasible
            shown = np.concatenate([shown, *(each.population for each in self.generations[-1:])])
        return Scatter(scene=self.scene, shown=shown)

    @cached_property
    def _views(self) -> FrontViews:
        final = None if self.end.front is None else self.end.front.objectives
        return FrontViews(scatter=self._scatter, generations=self.generations, final=final)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of([each.points for each in self.generations])

    @cached_property
    def _motions(self) -> MotionScene | None:
        points = [*self._walk, *self._end_points, *(point for each in self.generations for point in each.points)]
        if self.cell is None or not any(point.motion is not None and point.axis is None for point in points):
            return None
        return MotionScene(workcell=self.cell, names=self.scene.names, points=points)

    @cached_property
    def _postures(self) -> Chart | None:
        """The joints along the front if arms stand still, since curves over time would be straight lines."""
        cell, front = self.cell, self.end.front
        standing = all(point.motion is not None and point.motion.is_standing for point in self._end_points)
        if cell is None or front is None or not self._end_points or not standing or front.motions is None:
            return None
        postures = np.asarray(front.motions.q)[:, 0]
        return posture_chart(cell, front.objectives[:, 0], postures, self.scene.label(0))

    @property
    def _layout(self) -> Layout:
        front, scene, motions = self.end.front, self.scene, self._motions
        walked, whole = len(self._walk), 0 if front is None else len(front)
        words = f"{walked} of {whole} points are on the timeline point." if walked < whole else ""
        chosen = "compromise" if self._nearest is None else "least-violating"
        postures = "" if self._postures is None else "postures of the final front"
        solid = CHOSEN if front is not None and self.end.choice is not None else chosen  # the solid point at the end
        why = [] if self.end.choice is None else [rrb.TextDocumentView(origin=WHY, name="why")]
        views = motion_views(motions)
        if self._postures is not None:
            views["joints"] = [self._postures.view()]
        return Layout(
            legend=Legend(entries=search_entries(scene, motions, chosen=chosen, walked=walked > 1, postures=postures)),
            front=self._scatter.view(),
            charts=self._views.charts,
            texts=[text_view(f"{scene.timeline}, {solid}"), *why],
            timeline=scene.timeline,
            note=" ".join(filter(None, (self.note, words))),
            **views,
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
    kind = LoopDrawing if scene.timeline == "step" else SearchDrawing
    return kind(
        scene=search_scene(scene),
        cell=scene.workcell,
        generations=messages,
        end=SearchEnd(front=None) if end is None else end,
        note=" ".join(filter(None, (note, reduction_note(messages)))),
    )


class LiveSearch:
    """Draws a search or a closed loop while it runs; a generation that does not fit the axes gets new ones."""

    def __init__(self, scene: SearchedFront, stream: rr.RecordingStream, options: RecorderOptions) -> None:
        self._scene, self._cell, self._stream = search_scene(scene), scene.workcell, stream
        self.reduce = FrontReduction(maximised=scene.maximised, points=options.points).reduce
        self._views: FrontViews | None = None
        self._motions: MotionScene | None = None

    def record(self, generation: Generation) -> None:
        """Draw a generation."""
        stream, scene, points = self._stream, self._scene, generation.points
        stream.set_time(scene.timeline, sequence=generation.number)
        shown = generation.front if len(generation.front) else generation.population
        views, motions = self._views, self._motions
        if views is None:
            log_styles(scene, stream)
        if views is None or not views.scatter.fits(shown):
            views = FrontViews(scatter=Scatter(scene=scene, shown=shown))
            views.log(stream, static=False)
        if motions is None and self._cell is not None and has_motions(points):
            motions = MotionScene(workcell=self._cell, names=scene.names, points=points)
            motions.log(stream)
        if self._views is None or not self._views.scatter.canvases or motions is not self._motions:  # more is visible
            layout = Layout(
                legend=Legend(entries=search_entries(scene, motions)),
                front=views.scatter.view(),
                charts=[*views.charts, *series_views(scene)],
                texts=[text_view(scene.timeline)],
                timeline=scene.timeline,
                **motion_views(motions),
            )
            layout.log(stream)
        self._views, self._motions = views, motions
        views.log_generation(stream, generation, text_of(scene, generation))
        if motions is not None:
            motions.log_whole(stream, points)
