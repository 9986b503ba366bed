"""The recording of a search: all generations on common axes, then the front, its points one by one, and motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve, HypervolumeOptions
from paretoik.review.drawing.axes import entity_names
from paretoik.review.drawing.charts import Chart, fit_below_tabs
from paretoik.review.drawing.layout import Entry, Layout, Legend, drawn_entries, log_text, set_times, text_view
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
    infeasible_text,
    point_text,
    reason_text,
    text_of,
)
from paretoik.review.drawing.scatter import Area, Points, Scatter, replay_window
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, even_rows
from paretoik.review.recording.messages import RecordedPoint, end_points, front_point
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd
from paretoik.search.maximin import greedy_order, scaled, starting_points

WHY = "notes/why"  # entity of the reason of the choice


def search_entries(
    scene: SearchedFront,
    motions: MotionScene | None,
    *,
    chosen: str = "compromise",
    walked: bool = False,
    postures: str = "",
) -> list[Entry]:
    """Return the names and colours in a search's drawing; ``walked``: whether it shows points one by one.

    ``postures``: name of the postures drawn behind arms that stand still, "" for none.
    """
    loop, several = scene.timeline == "step", len(scene.names) > 1
    entries = drawn_entries(
        ({"level": "dominated", "refinement": "before"}.get(scene.timeline, "population"), SCREEN.population, not loop),
        ("front of the step" if loop else "front", SCREEN.front, True),
        (chosen, SCREEN.chosen, True),
        ("final front", SCREEN.final, not loop),
        ("ε: bound of this level", SCREEN.epsilon, scene.timeline == "level"),
        ("move of a point", SCREEN.moves, scene.timeline == "refinement"),
        *((f"best {name}", SCREEN.end(axis), several and not loop) for axis, name in enumerate(scene.names)),
        ("point looked at", SCREEN.arm, walked and not loop),
    )
    arm = f"arm of the {chosen}" if chosen == "compromise" else "arm"
    arm = f"{arm}, or of the point looked at" if walked else arm
    return entries if motions is None else entries + motions.entries(arm, postures=postures)


def search_charts(scene: SearchedFront, generations: Sequence[Generation]) -> list[Chart]:
    """Return the charts over the generations: hypervolume, best values, sizes; a single objective's best is first."""
    shown = [generation for generation in generations if len(generation.front)]
    if not shown:
        return []
    numbers, charts = np.array([generation.number for generation in shown], dtype=float), list[Chart]()
    across = {"refinement": "refinement: 0 before, 1 after"}.get(scene.timeline, scene.timeline)
    if scene.timeline == "step":  # the chosen values, and the best and worst of each step's front
        for axis in range(len(scene.names)):
            ranges = np.array([np.sort([each.front[:, axis].min(), each.front[:, axis].max()]) for each in shown])
            ranges = ranges[:, ::-1] if scene.maximised[axis] else ranges
            chosen = np.array([np.nan if each.chosen is None else each.chosen[axis] for each in shown])
            curves, names = np.stack([ranges[:, 0], ranges[:, 1], chosen]), ["best", "worst", "chosen"]
            label, colours = scene.label(axis), [SCREEN.population, SCREEN.frame, SCREEN.chosen]
            apart, whole = np.nanmax(np.ptp(ranges, axis=1), initial=0.0), np.nanmax(curves) - np.nanmin(curves)
            if apart < MARKS.line * whole / VIEWS.chart[1]:  # the curves would overlap
                label = f"chosen {label}; best and worst of a step at most {apart:.2g} apart"
                curves, names, colours = curves[2:], names[2:], colours[2:]
            more = {"names": names, "title": scene.label(axis)}
            charts.append(Chart.over(across, f"chosen_{axis}", label, numbers, curves, colours, **more))
        return fit_below_tabs(charts)
    volumes = np.array([[np.nan if each.hypervolume is None else each.hypervolume for each in shown]])
    label = f"hypervolume [{scene.volume_unit}]"
    volume = Chart.over(across, "hypervolume", label, numbers, volumes, [SCREEN.front])
    for axis, values in enumerate(np.array([scene.best(generation.front) for generation in shown]).T):
        label, colour = f"best {scene.label(axis)}", SCREEN.end(axis)
        charts.append(Chart.over(across, f"best_{axis}", label, numbers, values[None], [colour]))
    counts = np.array([[each.count, each.failed] for each in shown], dtype=float).T
    more, colours = {"names": ["front", "failed"]}, [SCREEN.front, SCREEN.failed]
    sizes = Chart.over(across, "counts", "front points, failures", numbers, counts, colours, **more)
    return fit_below_tabs([*charts, volume, sizes] if len(scene.names) == 1 else [volume, *charts, sizes])


def log_generation(
    stream: rr.RecordingStream,
    scatter: Scatter,
    charts: Sequence[Chart],
    generation: Generation,
    words: str,
    behind: Sequence[Points] = (),
) -> None:
    """Draw a generation or step at the current time with its text, and record its numbers; see ``Scatter``."""
    scene, chosen = scatter.scene, generation.chosen
    scatter.log_generation(stream, generation, behind=behind)
    if generation.hypervolume is not None:
        stream.log("search/hypervolume", rr.Scalars(generation.hypervolume))
    stream.log("search/counts", rr.Scalars([float(generation.count), float(generation.failed)]))
    series = {"best": scene.best(generation.front) if len(generation.front) else None, "chosen": chosen}
    for kind, values in series.items():
        for name, value in zip(entity_names(scene.names), [] if values is None else values, strict=values is not None):
            stream.log(["search", kind, name], rr.Scalars(float(value)))
    log_text(stream, words)
    for chart in charts:
        chart.log_cursor(stream, float(generation.number))


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchDrawing:
    """The generations of a search (``messages``) and its ``end``; ``note``: text on what was left out.

    It has these timelines. All of them show the end of the search or, before it, the last generation:

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
        front, motions, moved = self.end.front, self._motions, None
        self._scatter.log_axes(stream)
        for drawn in (*self._charts, motions, self._postures):
            if drawn is not None:
                drawn.log(stream)
        if front is not None:  # drawn behind all other layers
            self._scatter.log_points(stream, "final", front.objectives, static=True)
        if self._postures is not None and motions is not None:
            motions.log_postures(stream, self._postures.curves.T)
        if self.end.choice is not None:
            log_text(stream, reason_text(self.end.choice), WHY, static=True)
        for place, generation in enumerate(self.messages):
            number = generation.number
            set_times(stream, **{self.scene.timeline: number, "replay": float(self._clock.begins[place])})
            if generation is self.messages[-1]:
                self._at_the_end(stream)
            # the generation whose motions are shown: this one if its points are the same
            moved = generation if has_motions(generation.points) else moved
            same = moved is not None and [p.id for p in moved.points] == [p.id for p in generation.points]
            shown = number if same else None if moved is None else moved.number
            end = "the final front" if self.end.least_violating is None else "the last population"
            outside = self._scatter.outside(generation.population)
            words = text_of(self.scene, generation, shown, outside=outside, end=end)
            behind = [] if front is None else [front.objectives]
            log_generation(stream, self._scatter, self._charts, generation, words, behind)
            if motions is not None:
                motions.log_whole(stream, generation.points)
        self._log_end(stream)
        stream.reset_time()
        if motions is not None:  # move the final arms on ``motion``, those of generations with motions on ``replay``
            for point in self._end_points:
                motions.send_motion(stream, point)
            slots = [(float(self._clock.begins[i]), self.messages[i].points) for i in sorted(self._clock.moving)]
            slots += [(self._clock.end, self._end_points)] if is_moving(self._end_points) else []
            motions.send_replay(stream, slots)
        if front is not None and len(self._walk) > 1:  # show the points one by one, unless there is a single point
            rows = {int(number): row for row, number in enumerate(front.ids)}
            for place, point in enumerate(self._walk):
                set_times(stream, point=place)
                self._scatter.log_looked_at(stream, point, marked=self._end_points, avoid=self._avoid)
                self._log_words(stream, front, point_text(front, rows[point.id], chosen=self.end.choice))
                if motions is not None:
                    motions.log_whole(stream, [point])
                if self._postures is not None:
                    self._postures.log_cursor(stream, float(point.objectives[0]))
        self._layout.log(stream)

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Set the time to the end, on all timelines."""
        times: dict[str, float] = {self.scene.timeline: self.messages[-1].number if self.messages else 0}
        times["replay"] = self._clock.end
        times |= {"motion": 0.0} if is_moving(self._end_points) else {}
        set_times(stream, **times, **({"point": 0} if len(self._walk) > 1 else {}))

    def _log_end(self, stream: rr.RecordingStream) -> None:
        """Draw the last front with its choice and motions."""
        front, choice, nearest, scatter = self.end.front, self.end.choice, self.end.least_violating, self._scatter
        self._at_the_end(stream)
        if front is not None:
            names = [f"point {number}" for number in front.ids]
            scatter.log_points(stream, "front", front.objectives, ids=front.ids, names=names)
            if choice is not None:
                self._log_words(stream, front, point_text(front, choice.index, chosen=choice))
        elif nearest is not None:
            units, cell = self.scene.units, self.scene.workcell
            log_text(stream, infeasible_text(self.scene.names, units, nearest, cell, "No feasible point"))
        else:
            return
        scatter.log_marked(stream, self._end_points, avoid=self._avoid)
        if self._motions is not None:
            self._motions.log_whole(stream, self._end_points)
        if self._postures is not None and choice is not None:
            self._postures.log_cursor(stream, float(choice.objectives[0]))

    def _log_words(self, stream: rr.RecordingStream, front: Front, words: str) -> None:
        """Show the text of a point, and the number of infeasible individuals that dominate the front."""
        for last in self.messages[-1:]:
            words += f"\n\n{better_but_infeasible(self.scene, last.population, front.objectives)}"
        log_text(stream, words.rstrip())

    @cached_property
    def _walk(self) -> list[RecordedPoint]:
        """Points along the last front, including the chosen one."""
        front, choice = self.end.front, self.end.choice
        if front is None or not len(front):
            return []
        rows = set(even_rows(len(front), DRAWING.walk).tolist()) | (set() if choice is None else {choice.index})
        return [front_point(front, row) for row in sorted(rows)]

    @cached_property
    def _avoid(self) -> Area:
        """Points on all that is drawn at the end: the front, and the last generation with its lines."""
        front = [] if self.end.front is None else [self.end.front.objectives]
        areas = [self._scatter.area(*front, *(each.population for each in self.messages[-1:]))]
        return np.concatenate([*areas, *(self._scatter.lines(each) for each in self.messages[-1:])])

    @cached_property
    def _end_points(self) -> tuple[RecordedPoint, ...]:
        """The points drawn individually at the end: of the front, the least-violating, or the last generation's."""
        nearest = self.end.least_violating
        if self.end.front is not None:
            return end_points(self.end.front, self.end.choice)
        if nearest is not None:
            return () if nearest.point is None else (nearest.point,)
        with_motions = [each.points for each in self.messages if has_motions(each.points)]
        return with_motions[-1] if with_motions else ()

    @cached_property
    def _scatter(self) -> Scatter:
        fronts = [each.front for each in self.messages]
        fronts += [] if self.end.front is None else [self.end.front.objectives]
        if fronts and len(fronts[-1]) and self.scene.timeline != "refinement":  # a refinement shows both of its fronts
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
        """The joints along the front if arms stand still: their curves over time would be straight lines."""
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
            words = f"At most {max(reduced)} points of an intermediate front are drawn: ends, and others between."
            notes.append(words)
        walked, whole = len(self._walk), 0 if front is None else len(front)
        if walked < whole:
            notes.append(f"{walked} of {whole} points are on the timeline point.")
        chosen = "compromise" if self.end.least_violating is None else "least-violating"
        postures = "" if self._postures is None else "postures of the final front"
        solid = CHOSEN if front is not None and self.end.choice is not None else chosen  # its name at the end
        why = [] if self.end.choice is None else [rrb.TextDocumentView(origin=WHY, name="why")]
        views = motion_views(motions) | ({} if self._postures is None else {"joints": [self._postures.view()]})
        return Layout(
            legend=Legend(entries=search_entries(scene, motions, chosen=chosen, walked=walked > 1, postures=postures)),
            front=self._scatter.view(),
            charts=[chart.view() for chart in self._charts],
            texts=[text_view(f"{scene.timeline}, {solid}"), *why],
            timeline=scene.timeline,
            note=" ".join(filter(None, notes)),
            **views,
        )


class FrontReduction:
    """Reduces generations of a search, whose objectives may be ``maximised``, to at most ``points`` points."""

    def __init__(self, *, maximised: tuple[bool, ...], points: int) -> None:
        self._signs = np.where(maximised, -1.0, 1.0)
        self._points = points
        # the recording process has time for this, the run has not
        self._hypervolume = HypervolumeCurve(HypervolumeOptions(share=0.25))

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
