"""The recording of a closed loop that is over: every step at its sample of the motion, and the searches of some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.parallel_axes import ParallelAxes
from paretoik.review.drawing.point_text import beginning_text, text_of
from paretoik.review.drawing.recording_layout import TEXT, Layout, note_view, text_view
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing.search_charts import DrawnChart, log_series, search_charts
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.drawing.step_scene import StepScene
from paretoik.review.recording.recorded_end import chosen_point
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedLoop:
    """The steps of a closed loop as ``generations``, and its ``end`` with the motion; ``note``: what was left out."""

    scene: SearchScene
    recorded: SearchedFront
    generations: Sequence[Generation]
    end: SearchEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._log_still(stream)
        self._log_beginning(stream)
        for generation in self.generations:
            self._set_time(stream, generation.number)
            self._log_step(stream, generation)
        stream.reset_time()
        self._send_motion(stream)
        if self._searches and self.generations:
            for timeline in ("generation", "individual"):  # of searched steps: the loop stands still meanwhile
                stream.set_time(timeline, sequence=0)
            self._log_step(stream, self._opening or self.generations[-1])
        for each in self._searches:
            each.log(stream, self._times_of(each.step.sample))
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_still(self, stream: rr.RecordingStream) -> None:
        self.scene.log_axes(stream, self._canvases, static=True)
        self._layout.legend.log(stream)
        if self._parallel is not None:
            self._parallel.log(stream, static=True)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self._motions is not None:
            self._motions.log(stream)
        if self.note:
            stream.log("notes/left_out", rr.TextDocument(self.note), static=True)

    def _log_beginning(self, stream: rr.RecordingStream) -> None:
        """Say at step 0 why it has no front, and let the cursors stand at the first step that has one."""
        if not self.generations or self.generations[0].number == 0:
            return
        self._set_time(stream, 0)
        stream.log(TEXT, rr.TextDocument(beginning_text(self.generations[0].number), media_type="text/markdown"))
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(self.generations[0].number))

    def _set_time(self, stream: rr.RecordingStream, step: int) -> None:
        stream.reset_time()
        stream.set_time("step", sequence=step)
        for timeline, seconds in self._times_of(step).items():
            stream.set_time(timeline, duration=seconds)

    def _times_of(self, step: int) -> dict[str, float]:
        """Return when a step ends, on the timeline of the motion if there is one."""
        motion = None if self._point is None else self._point.motion
        return {} if motion is None else {"motion": float(motion.time[step])}

    def _log_step(self, stream: rr.RecordingStream, generation: Generation) -> None:
        self.scene.log_generation(stream, generation, self._canvases, self._parallel)
        log_series(self.scene, stream, generation)
        words = text_of(self.scene, generation)
        if self.end.choice is not None:
            words += "\n\n## The whole loop\n\n" + screen_text(self.end.choice.reason)
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(generation.number))

    def _send_motion(self, stream: rr.RecordingStream) -> None:
        """Let the arm move, a sample a step; before the first it stands at its start."""
        point = self._point
        if self._motions is None or point is None or point.motion is None:
            return
        times = point.motion.time
        columns = [rr.TimeColumn("motion", duration=times), rr.TimeColumn("step", sequence=np.arange(len(times)))]
        self._set_time(stream, 0)
        self._motions.log_whole(stream, [point], row=0)
        if self._searches and self._opening is not None:
            stream.reset_time()
            for timeline in ("generation", "individual"):
                stream.set_time(timeline, sequence=0)
            self._motions.log_whole(stream, [point], row=self._opening.number)
        stream.reset_time()
        self._motions.send(stream, point, columns)
        self._motions.send_series(stream, point, columns)

    @cached_property
    def _opening(self) -> Generation | None:
        """The step that the recording opens on: the first whose search was recorded, else that of the widest front.

        The widest has the largest product of ranges among those in which every objective varies.
        """
        recorded = {each.sample for each in self.end.searched}
        steps = [each for each in self.generations if each.number in recorded]
        if steps:
            return steps[0]
        widths = [
            np.log(np.ptp(each.front, axis=0)).sum()
            if len(each.front) and np.ptp(each.front, axis=0).all()
            else -np.inf
            for each in self.generations
        ]
        return self.generations[int(np.argmax(widths))] if widths and np.isfinite(max(widths)) else None

    @cached_property
    def _point(self) -> RecordedPoint | None:
        return None if self.end.choice is None else chosen_point(self.end.choice)

    @cached_property
    def _motions(self) -> MotionScene | None:
        cell = self.recorded.workcell
        if cell is None or self._point is None or self._point.motion is None:
            return None
        return MotionScene(workcell=cell, names=self.scene.names, points=[self._point], title="arm")

    @cached_property
    def _searches(self) -> list[StepScene]:
        return [StepScene(loop=self.scene, step=each, workcell=self.recorded.workcell) for each in self.end.searched]

    @cached_property
    def _canvases(self) -> list[Canvas]:
        fronts = [np.empty((0, len(self.scene.names))), *(each.front for each in self.generations)]
        return self.scene.canvases(np.concatenate(fronts))

    @cached_property
    def _parallel(self) -> ParallelAxes | None:
        fronts = [np.empty((0, len(self.scene.names))), *(each.front for each in self.generations)]
        return self.scene.parallel_axes(np.concatenate(fronts))

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        return search_charts(self.scene, self.generations)

    @cached_property
    def _layout(self) -> Layout:
        motions, opening = self._motions, self._opening
        parallel = [] if self._parallel is None else [self._parallel.view()]
        notes: list[rrb.View] = [note_view()] if self.note else []
        return Layout(
            legend=Legend(entity="legend", entries=search_entries(self.scene, motions, chosen="chosen")),
            front=self.scene.view() if self._canvases else None,
            charts=[*parallel, *(chart.view() for chart, _, _ in self._charts)],
            arm=None if motions is None else motions.view(),
            joints=[] if motions is None else [chart.view() for chart in motions.charts.values()],
            texts=[text_view("step"), *notes],
            timeline="step",
            start=None if opening is None else opening.number,
            end=self.generations[-1].number if self.generations else 0,
            name="loop",
            further=[each.view() for each in self._searches],
        )
