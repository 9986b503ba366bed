"""How a search is recorded: generations as they come, and at the end all of them on common axes, with a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.front.front import Choice, Front
from paretoik.review.curve_charts import Chart
from paretoik.review.drawn_axes import Canvas
from paretoik.review.front_reduction import FrontReduction
from paretoik.review.motion_scene import MotionScene
from paretoik.review.recorder import Generation, SearchedFront, SearchEnd
from paretoik.review.recording_process import RecorderOptions
from paretoik.review.search_scene import SearchScene, replay_window
from paretoik.review.step_scene import StepScene

NOTE = "notes/left_out"  # entity of what is said of what is not in the recording


class Recording:
    """Draws a search into a stream; errors of Rerun are raised.

    While the search runs, each generation is drawn on its own axes. The common axes of all are known only at its end,
    so `finish` draws all of them again, into another stream.
    """

    def __init__(self, scene: SearchedFront, stream: rr.RecordingStream, options: RecorderOptions) -> None:
        self._scene = SearchScene(
            names=scene.names, units=scene.units, maximised=scene.maximised, timeline=scene.timeline
        )
        self._stream = stream
        self._reduction = FrontReduction(maximised=scene.maximised, points=options.points)
        self._generations: list[Generation] = []
        self._canvases: list[Canvas] = []
        self._notes: list[rrb.View] = []
        self._scene.log_styles(stream)

    def reduce(self, generation: Generation) -> Generation:
        """Return a generation with at most so many points as are drawn, and its hypervolume."""
        return self._reduction.reduce(generation)

    def record(self, generation: Generation) -> None:
        """Draw a generation while the search goes on."""
        self._stream.set_time(self._scene.timeline, sequence=generation.number)
        shown = generation.front if len(generation.front) else generation.population
        if not self._scene.fits(self._canvases, shown):
            without_panels = not self._canvases
            self._canvases = self._scene.canvases(shown)
            self._scene.log_axes(self._stream, self._canvases, static=False)
            if not self._generations or (without_panels and self._canvases):
                self._stream.send_blueprint(self._blueprint(self._canvases))
        self._scene.log_generation(self._stream, generation, self._canvases)
        self._generations.append(generation)

    def finish(self, generations: Sequence[Generation], end: SearchEnd | None, note: str) -> None:
        """Draw everything on common axes, at the end the front and the motion of the choice, and a note if any.

        Without a front each generation stands at its own sample of the motion, and the search of some is shown beside
        them. Without an end the last generation is the end.
        """
        self._generations = list(generations)
        end = SearchEnd(front=None) if end is None else end
        note = " ".join(filter(None, (note, self._reduction.note())))
        if note:
            self._stream.log(NOTE, rr.TextDocument(note), static=True)
            self._notes = [rrb.TextDocumentView(origin=NOTE, name="what was left out")]
        self._write_all(end.front, end.choice, [StepScene(loop=self._scene, step=each) for each in end.searched])

    def _write_all(self, front: Front | None, choice: Choice | None, searched: Sequence[StepScene]) -> None:
        stream, scene = self._stream, self._scene
        fronts = [each.front for each in self._generations] + ([] if front is None else [front.objectives])
        if scene.timeline != "step" and fronts and len(fronts[-1]):
            shown = replay_window(fronts)
        else:
            shown = np.concatenate([np.empty((0, len(scene.names))), *fronts])
        canvases = scene.canvases(shown)
        charts = scene.charts(self._generations)
        motion = None
        if choice is not None and choice.motion is not None:
            others = None if front is None else front.motions
            motion = MotionScene(motion=choice.motion, title=f"motion of point {choice.id}", others=others)
        stream.send_blueprint(self._blueprint(canvases, charts, motion, searched))
        scene.log_axes(stream, canvases, static=True)
        for chart in charts:
            chart.log(stream)
            chart.send_cursor(stream, [rr.TimeColumn(scene.timeline, sequence=chart.instants.astype(int))])
        if front is None:
            self._write_steps(canvases, charts, motion)
        else:
            self._write_end(front, choice, canvases, charts, motion)
        if searched and self._generations:
            stream.reset_time()
            for timeline in ("generation", "individual"):  # of searched steps: the loop stands still meanwhile
                stream.set_time(timeline, sequence=0)
            scene.log_generation(stream, self._generations[-1], canvases)
        for each in searched:
            each.log(stream, {} if motion is None else {"motion": float(motion.motion.time[each.step.sample])})

    def _write_steps(self, canvases: Sequence[Canvas], charts: Sequence[Chart], motion: MotionScene | None) -> None:
        """Write every step at its number and at the time at which it ends."""
        stream, scene = self._stream, self._scene
        for generation in self._generations:
            stream.set_time(scene.timeline, sequence=generation.number)
            if motion is not None:
                stream.set_time("motion", duration=float(motion.motion.time[generation.number]))
            scene.log_generation(stream, generation, canvases)
        if motion is not None:
            for chart in charts:
                at = motion.motion.time[chart.instants.astype(int)]
                chart.send_cursor(stream, [rr.TimeColumn("motion", duration=at)])
            motion.log(stream, rr.TimeColumn(scene.timeline, sequence=np.arange(len(motion.motion.time))))

    def _write_end(
        self,
        front: Front,
        choice: Choice | None,
        canvases: Sequence[Canvas],
        charts: Sequence[Chart],
        motion: MotionScene | None,
    ) -> None:
        """Write all generations; the last, with the front and the choice, stands on both timelines."""
        stream, scene = self._stream, self._scene
        for generation in self._generations[:-1]:
            stream.set_time(scene.timeline, sequence=generation.number)
            scene.log_generation(stream, generation, canvases)
        last = self._generations[-1].number if self._generations else 0
        stream.set_time(scene.timeline, sequence=last)
        stream.set_time("motion", duration=0.0)
        if self._generations:
            end = self._generations[-1]
            origins = end.origins if len(end.front) == len(front) else None  # else some are left out
            end = replace(end, front=front.objectives, front_ids=front.ids, epsilon=None, origins=origins)
            scene.log_generation(stream, end, canvases, named=True)
        else:
            scene.log_points(stream, "front", front.objectives, canvases, ids=front.ids, named=True)
        if choice is not None:
            chosen = np.array([choice.id])
            scene.log_points(stream, "chosen", choice.objectives[None], canvases, ids=chosen, named=True)
        for chart in charts:
            chart.send_cursor(stream, [rr.TimeColumn("motion", duration=[0.0])], chart.instants[-1:])
        if motion is not None:
            motion.log(stream, rr.TimeColumn(scene.timeline, sequence=np.full(len(motion.motion.time), last)))

    def _blueprint(
        self,
        canvases: Sequence[Canvas],
        charts: Sequence[Chart] = (),
        motion: MotionScene | None = None,
        searched: Sequence[StepScene] = (),
    ) -> rrb.Blueprint:
        panels = self._scene.views(canvases)
        chart_views = [chart.view() for chart in charts]
        if not panels and chart_views:
            panels, chart_views = chart_views[:1], chart_views[1:]
        indicators = rrb.Tabs(*chart_views, *self._scene.series_views()[len(chart_views) :], *self._notes)
        above = rrb.Grid(*panels, grid_columns=self._scene.columns)
        search = rrb.Vertical(above, indicators, row_shares=[2.6, 1]) if panels else indicators
        layout: rrb.Container = search
        if motion is not None:
            arm, joints = motion.views()
            layout = rrb.Horizontal(search, rrb.Vertical(arm, rrb.Tabs(*joints), row_shares=[2.6, 1]))
        if searched:
            layout = rrb.Tabs(rrb.Vertical(layout, name="loop"), *(each.view() for each in searched))
        return rrb.Blueprint(
            layout,
            rrb.BlueprintPanel(state="hidden"),
            rrb.SelectionPanel(state="hidden"),
            rrb.TimePanel(timeline=self._scene.timeline, state="collapsed"),
            auto_views=False,
        )
