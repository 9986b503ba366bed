"""The recording of a search: all generations on common axes, then the front, its points one by one, and motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Objectives
from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve, HypervolumeOptions
from paretoik.review.drawing.charts import Chart
from paretoik.review.drawing.layout import Layout, Legend, log_text, text_view
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
from paretoik.review.drawing.scatter import NO_POINTS, Area, Scatter, replay_window
from paretoik.review.drawing.search_charts import log_generation, search_charts, search_entries
from paretoik.review.palette import DRAWING, even_rows
from paretoik.review.recording.messages import LeastViolating, RecordedPoint, end_points, front_point
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd
from paretoik.search.maximin import greedy_order, scaled, starting_points

WHY = "notes/why"  # entity of the reason of the choice


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchDrawing:
    """The generations of a search (``messages``) and its ``end``; ``note``: text on what was left out.

    It has these timelines, and all of them show the end, or else the last generation:

    - ``generation``, ``level`` or ``refinement``: the generations
    - ``motion``: the last motions, if an arm moves
    - ``replay``: the motions of the generations, one after another
    - ``point``: the points of the last front one by one, if it has several
    """

    scene: SearchedFront
    messages: Sequence[Generation]
    end: SearchEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        front, motions, last, moved = self.end.front, self._motions, len(self.messages) - 1, None
        self._scatter.log_axes(stream)
        for drawn in (*self._charts, motions, self._postures):
            if drawn is not None:
                drawn.log(stream)
        if front is not None:  # behind all others
            self._scatter.log_points(stream, "final", front.objectives, static=True)
        if self._postures is not None and motions is not None:
            motions.log_postures(stream, self._postures.curves.T)
        if self.end.choice is not None:
            log_text(stream, reason_text(self.end.choice), WHY, static=True)
        for place, generation in enumerate(self.messages):
            stream.reset_time()
            stream.set_time(self.scene.timeline, sequence=generation.number)
            stream.set_time("replay", duration=float(self._clock.begins[place]))
            if place == last:
                self._at_the_end(stream)
            # the generation whose motions are shown: itself if the points are the same
            moved = generation if has_motions(generation.points) else moved
            same = moved is not None and [p.id for p in moved.points] == [p.id for p in generation.points]
            number = generation.number if same else None if moved is None else moved.number
            end = "the final front" if self._nearest is None else "the last population"
            outside = self._scatter.outside(generation.population)
            words = text_of(self.scene, generation, number, outside=outside, end=end)
            behind = None if front is None else front.objectives
            log_generation(stream, self._scatter, self._charts, generation, words, behind)
            if motions is not None:
                motions.log_whole(stream, generation.points)
        stream.reset_time()
        self._at_the_end(stream)
        self._log_end(stream)
        stream.reset_time()
        if motions is not None:  # move the final arms on ``motion``, those of generations with motions on ``replay``
            for point in self._end_points:
                motions.send_motion(stream, point)
            slots = [(float(self._clock.begins[i]), self.messages[i].points) for i in sorted(self._clock.moving)]
            slots += [(self._clock.end, self._end_points)] if is_moving(self._end_points) else []
            motions.send_replay(stream, slots)
        if front is not None and len(self._walk) > 1:  # a single point is visible anyway
            self._log_walk(stream, front)
        stream.reset_time()
        self._layout.log(stream)

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Set the time to the end, on all timelines."""
        last = self.messages[-1].number if self.messages else 0
        stream.set_time(self.scene.timeline, sequence=last)
        stream.set_time("replay", duration=self._clock.end)
        if is_moving(self._end_points):
            stream.set_time("motion", duration=0.0)
        if len(self._walk) > 1:
            stream.set_time("point", sequence=0)

    def _log_end(self, stream: rr.RecordingStream) -> None:
        """Draw the last front with its choice and motions.

        If nothing is feasible, the least-violating point is drawn, with the constraints that it breaks.
        """
        front, choice, nearest, scatter = self.end.front, self.end.choice, self._nearest, self._scatter
        if front is not None:
            names = [f"point {number}" for number in front.ids]
            scatter.log_points(stream, "front", front.objectives, ids=front.ids, names=names)
            if choice is not None:
                self._log_words(stream, front, choice_text(front, choice, whole=False))
        elif nearest is not None:
            units, cell = self.scene.units, self.scene.workcell
            log_text(stream, infeasible_text(self.scene.names, units, nearest, cell, "No feasible point"))
        else:
            return
        scatter.log_marked(stream, self._end_points, avoided=self._drawn, taken=self._lines)
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)
        if self._postures is not None and choice is not None:
            self._postures.log_cursor(stream, float(choice.objectives[0]))

    def _log_words(self, stream: rr.RecordingStream, front: Front, words: str) -> None:
        """Show the text of a point, and the number of individuals behind the front that look better."""
        for last in self.messages[-1:]:
            words += f"\n\n{better_but_infeasible(self.scene, last.population, front.objectives)}"
        log_text(stream, words.rstrip())

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
        return np.concatenate([*front, *(each.population for each in self.messages[-1:])])

    @cached_property
    def _lines(self) -> Area:
        """Points [pixels] on the lines of the last generation, which are visible at the end."""
        return self._scatter.line_points(self.messages[-1]) if self.messages else NO_POINTS

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The individually drawn points at the end: of the front, the least-violating, or the last generation's."""
        if self.end.front is not None:
            return end_points(self.end.front, self.end.choice)
        if self._nearest is not None:
            return () if self._nearest.point is None else (self._nearest.point,)
        with_motions = [each.points for each in self.messages if has_motions(each.points)]
        return with_motions[-1] if with_motions else ()

    @property
    def _nearest(self) -> LeastViolating | None:
        """The least-violating point if nothing is feasible."""
        return self.end.least_violating

    @cached_property
    def _scatter(self) -> Scatter:
        fronts = [each.front for each in self.messages]
        fronts += [] if self.end.front is None else [self.end.front.objectives]
        if fronts and len(fronts[-1]) and self.scene.timeline != "refinement":  # both of its fronts are looked at
            return Scatter(scene=self.scene, shown=replay_window(fronts))
        shown = np.concatenate([np.empty((0, len(self.scene.names))), *fronts])
        if not len(shown):  # nothing is feasible
            shown = np.concatenate([shown, *(each.population for each in self.messages[-1:])])
        return Scatter(scene=self.scene, shown=shown)

    @cached_property
    def _charts(self) -> list[Chart]:
        return search_charts(self.scene, self.messages)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of([each.points for each in self.messages])

    @cached_property
    def _motions(self) -> MotionScene | None:
        points = [*self._walk, *self._end_points, *(point for each in self.messages for point in each.points)]
        cell = self.scene.workcell
        if cell is None or not any(point.motion is not None and point.axis is None for point in points):
            return None
        return MotionScene(workcell=cell, names=self.scene.names, points=points)

    @cached_property
    def _postures(self) -> Chart | None:
        """The joints along the front if arms stand still, since curves over time would be straight lines."""
        cell, front = self.scene.workcell, self.end.front
        standing = all(point.motion is not None and point.motion.is_standing for point in self._end_points)
        if cell is None or front is None or not self._end_points or not standing or front.motions is None:
            return None
        postures = np.asarray(front.motions.q)[:, 0]
        return posture_chart(cell, front.objectives[:, 0], postures, self.scene.label(0))

    @property
    def _layout(self) -> Layout:
        front, scene, motions, notes = self.end.front, self.scene, self._motions, [self.note]
        reduced = [len(each.front) for each in self.messages if each.count > len(each.front)]
        if reduced:
            words = f"At most {max(reduced)} points of an intermediate front are drawn, spread over it, with its ends."
            notes.append(words)
        walked, whole = len(self._walk), 0 if front is None else len(front)
        if walked < whole:
            notes.append(f"{walked} of {whole} points are on the timeline point.")
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
            charts=[chart.view() for chart in self._charts],
            texts=[text_view(f"{scene.timeline}, {solid}"), *why],
            timeline=scene.timeline,
            note=" ".join(filter(None, notes)),
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
        """Return a generation with fewer points: the best of each objective, and others spread over its front."""
        volume, front = generation.hypervolume, generation.front
        if volume is None and generation.reference is not None:
            reference = generation.reference * self._signs
            volume = self._hypervolume.measure(front * self._signs, generation.number, reference)
        generation = replace(generation, hypervolume=volume, size=len(front))
        if len(front) <= self._points:
            return generation
        # the best of each objective, then by MaxiMin, see Marcos et al. (2012) and search.maximin
        F = front * self._signs
        Z = scaled(F, F.min(axis=0), F.max(axis=0))
        starts = list(dict.fromkeys([*F.argmin(axis=0).tolist(), *starting_points(Z)]))[: self._points]
        rows = np.sort(greedy_order(Z, self._points, np.full(len(Z), np.inf), starts)[0])
        origins = None if generation.origins is None else generation.origins[rows]
        return replace(generation, front=front[rows], front_ids=generation.front_ids[rows], origins=origins)
