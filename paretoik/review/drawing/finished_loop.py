"""The recording of a closed loop that is over: every step at its sample of the motion, and the searches of some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr

from paretoik.review.drawing.front_views import FrontViews, RecordedSearch
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.point_text import beginning_text, loop_guide, search_hint, text_of
from paretoik.review.drawing.recording_layout import TEXT, Layout, text_view
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing.step_scene import StepScene
from paretoik.review.recording.recorded_end import chosen_point
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Generation


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedLoop:
    """A closed loop: its steps as the generations of a ``search``, at whose end is its motion."""

    search: RecordedSearch

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._log_still(stream)
        self._log_beginning(stream)
        for generation in self._steps:
            self._set_time(stream, generation.number)
            self._log_step(stream, generation)
        stream.reset_time()
        self._send_motion(stream)
        if self._searches and self._steps:
            for timeline in ("generation", "individual"):  # of searched steps: the loop stands still meanwhile
                stream.set_time(timeline, sequence=0)
            self._log_step(
                stream, self._opening or self._steps[-1], search_hint([each.step.sample for each in self._searches])
            )
        for each in self._searches:
            each.log(stream, self._times_of(each.step.sample))
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_still(self, stream: rr.RecordingStream) -> None:
        self._views.log(stream)
        self._layout.legend.log(stream)
        if self._motions is not None:
            self._motions.log(stream)

    def _log_beginning(self, stream: rr.RecordingStream) -> None:
        """Say at step 0, beside its picture and in it, why it has no front; cursors stand at the first that has one."""
        if not self._steps or self._steps[0].number == 0:
            return
        self._set_time(stream, 0)
        stream.log(TEXT, rr.TextDocument(beginning_text(self._steps[0].number), media_type="text/markdown"))
        self._views.log_cursors(stream, self._steps[0].number)
        self._views.log_note(stream, f"no front before step {self._steps[0].number}")
        self._set_time(stream, self._steps[0].number)
        self._views.log_note(stream, "")

    def _set_time(self, stream: rr.RecordingStream, step: int) -> None:
        stream.reset_time()
        stream.set_time("step", sequence=step)
        for timeline, seconds in self._times_of(step).items():
            stream.set_time(timeline, duration=seconds)

    def _times_of(self, step: int) -> dict[str, float]:
        """Return when a step ends, on the timeline of the motion if there is one."""
        motion = None if self._point is None else self._point.motion
        return {} if motion is None else {"motion": float(motion.time[step])}

    def _log_step(self, stream: rr.RecordingStream, generation: Generation, hint: str = "") -> None:
        """Draw a step at the current time, with what is to be known of it, a hint first."""
        choice, opening = self.search.end.choice, None if self._opening is None else self._opening.number
        words = [hint, text_of(self.search.scene, generation)]
        if choice is not None:
            words.append(f"## The whole loop\n\n{screen_text(choice.reason)}")
        words.append(loop_guide([each.step.sample for each in self._searches], opening))
        self._views.log_generation(stream, generation, "\n\n".join(filter(None, words)))

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
        recorded = {each.sample for each in self.search.end.searched}
        steps = [each for each in self._steps if each.number in recorded]
        if steps:
            return steps[0]
        widths = [
            np.log(np.ptp(each.front, axis=0)).sum()
            if len(each.front) and np.ptp(each.front, axis=0).all()
            else -np.inf
            for each in self._steps
        ]
        return self._steps[int(np.argmax(widths))] if widths and np.isfinite(max(widths)) else None

    @cached_property
    def _point(self) -> RecordedPoint | None:
        return None if self.search.end.choice is None else chosen_point(self.search.end.choice)

    @cached_property
    def _motions(self) -> MotionScene | None:
        cell = self.search.recorded.workcell
        if cell is None or self._point is None or self._point.motion is None:
            return None
        return MotionScene(workcell=cell, names=self.search.scene.names, points=[self._point], title="arm")

    @cached_property
    def _searches(self) -> list[StepScene]:
        scene, cell = self.search.scene, self.search.recorded.workcell
        return [StepScene(loop=scene, step=each, workcell=cell) for each in self.search.end.searched]

    @property
    def _steps(self) -> Sequence[Generation]:
        return self.search.generations

    @cached_property
    def _views(self) -> FrontViews:
        fronts = [np.empty((0, len(self.search.scene.names))), *(each.front for each in self._steps)]
        return FrontViews(search=self.search, shown=np.concatenate(fronts), note=self.search.note)

    @cached_property
    def _layout(self) -> Layout:
        motions, opening = self._motions, self._opening
        return Layout(
            legend=Legend(entity="legend", entries=search_entries(self.search.scene, motions, chosen="chosen")),
            front=self._views.front,
            charts=self._views.charts,
            arm=None if motions is None else motions.view(),
            joints=[] if motions is None else [chart.view() for chart in motions.charts.values()],
            texts=[text_view("step"), *self._views.notes],
            timeline="step",
            start=None if opening is None else opening.number,
            end=self._steps[-1].number if self._steps else 0,
            name="loop",
            further=[each.view() for each in self._searches],
        )
