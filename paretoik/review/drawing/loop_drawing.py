"""The recording of a closed loop: every step at its sample of the motion, and some searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int

from paretoik.review.drawing.arm import ArmDrawing, is_seen_beside, target_mark
from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart
from paretoik.review.drawing.layout import Layout, Legend, drawn_entries, log_text, set_times, text_view
from paretoik.review.drawing.motion import MotionScene, motion_views
from paretoik.review.drawing.point_text import NO_RANGE, loop_guide, outside_text, range_text, step_text
from paretoik.review.drawing.scatter import Scatter, normalised
from paretoik.review.drawing.search_drawing import log_generation, search_charts, search_entries
from paretoik.review.palette import SCREEN, VIEWS
from paretoik.review.recording.messages import RecordedPoint, Workcell, chosen_point
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchedStep, SearchEnd
from paretoik.review.words import counted
from paretoik.robot.kinematics import link_nodes

# The search of one control step: its generations, and the arm of every individual of the last one.
#
# The search has its own timelines, ``generation`` and ``individual``; the other timelines show its last generation from
# the end of the step on.


@dataclass(frozen=True, kw_only=True, eq=False)
class StepScene:
    """The search of one step of a closed ``loop``."""

    loop: SearchedFront
    step: SearchedStep

    def view(self) -> rrb.Container:
        """Return the views: the fronts, with the arm next to them, below a legend."""
        arm = self._drawing.view(f"{'arms of the front' if self._shows_arms else 'arm'}, step {self.step.sample}")
        text = rrb.TextDocumentView(origin=f"{self._root}/text", name="generation, individual")
        shown = [view for view in (self._scatter.view(), arm, text) if view is not None]
        views = rrb.Horizontal(*shown, column_shares=VIEWS.columns[-len(shown) :])
        return self._legend.above(views, f"search of step {self.step.sample}")

    def log(self, recording: rr.RecordingStream, end: Mapping[str, float]) -> None:
        """Log the search.

        Other timelines show its last generation from the ``end`` of the step on, a time [s] by name of the timeline.
        """
        self._legend.log(recording)
        self._scatter.log_axes(recording)
        self._drawing.log_workcell(recording)
        last = len(self.step.objectives) - 1
        for number in range(last + 1):
            set_times(recording, generation=number)
            self._log_generation(recording, number)
        for place in (0, self.step.sample):  # from the loop's beginning on, so that the tab is never empty
            set_times(recording, step=place, **{name: seconds if place else 0.0 for name, seconds in end.items()})
            self._log_generation(recording, last)
        alive = np.flatnonzero(np.isfinite(self.step.objectives[last]).all(axis=1))
        order = alive[np.argsort(self.step.objectives[last, alive, 0], kind="stable")].tolist()
        for place, individual in enumerate(order):
            set_times(recording, individual=place)
            if place == 0:
                self._log_generation(recording, last)
            self._log_individual(recording, last, individual)
            words = f"## Point {individual}, rank {place + 1} of {len(order)} in {self.loop.names[0]}\n\n"
            words += "The weights choose it.\n\n" if individual == self.step.chosen[last] else ""
            self._log_text(recording, words + self._objectives(last, individual))
        recording.reset_time()

    def _log_generation(self, recording: rr.RecordingStream, number: int) -> None:
        """Draw a generation at the current time: its population and front, their text, and the arms of the front."""
        objectives, front, chosen = self.step.objectives[number], self.step.fronts[number], self.step.chosen[number]
        alive = np.isfinite(objectives).all(axis=1)
        drawing, names = self._drawing, [f"point {individual}" for individual in front]
        within = objectives[front] if len(front) else None
        self._scatter.log_points(recording, "population", objectives[alive], reference=within)
        self._scatter.log_points(recording, "front", objectives[front], ids=front, names=names, reference=within)
        links = list(self._links(number, front))
        ghosts = drawing.stage.strips(links, SCREEN.ghost, 1.0, 0.0, labels=names, show_labels=False)
        recording.log(f"{drawing.entity}/front", ghosts)
        recording.log(f"{drawing.entity}/place", target_mark(drawing, self.step.target))
        shown = objectives[alive] if within is None else normalised(objectives[alive], within)
        lines = [
            f"# Step {self.step.sample}, generation {number}",
            f"{counted(len(front), 'point')} on its front; of {counted(len(alive), 'individual')} "
            f"{(~alive).sum()} failed.",
            *outside_text(self._scatter.outside(shown), int(alive.sum()), "the front"),
        ]
        if len(front) == 1:
            lines += ["", NO_RANGE]
        if len(front) > 1 and not is_seen_beside(drawing, distance := self._distance(number)):
            lines += ["", f"All arms of the front lie under the white one, at most {distance:.2g} m from it."]
        if within is not None:
            ranges = zip(self.loop.names, within.min(axis=0), within.max(axis=0), self.loop.units, strict=True)
            lines += ["", "## Ranges of the front", ""]
            lines += [f"- **{name}**: {range_text(least, most, unit)}" for name, least, most, unit in ranges]
            lines += ["", "## Chosen by the weights", "", self._objectives(number, int(chosen))]
        self._log_text(recording, "\n".join(lines))
        if within is not None:
            self._log_individual(recording, number, int(chosen))

    def _log_individual(self, recording: rr.RecordingStream, number: int, individual: int) -> None:
        """Draw one individual of a generation: its objectives and its arm."""
        row, name = np.array([individual]), f"point {individual}"
        objectives = self.step.objectives[number, row]
        front = self.step.objectives[number, self.step.fronts[number]]
        self._scatter.log_points(recording, "chosen", objectives, ids=row, names=[name], reference=front)
        avoid = self._scatter.area(normalised(front, front))
        self._scatter.log_label(recording, "chosen", normalised(objectives, front), name, avoid=avoid)
        self._drawing.log_arm(recording, "chosen", self._links(number, row)[0], None)

    def _objectives(self, number: int, individual: int) -> str:
        named = zip(self.loop.names, self.step.objectives[number, individual], self.loop.units, strict=True)
        return "\n".join(f"- **{name}**: {value:.6g} {unit}".rstrip() for name, value, unit in named)

    def _log_text(self, recording: rr.RecordingStream, words: str) -> None:
        log_text(recording, screen_text(words), f"{self._root}/text")

    def _links(self, number: int, rows: Int[np.ndarray, " rows"]) -> Float[np.ndarray, "rows nodes 3"]:
        return np.asarray(link_nodes(self.step.arm, self.step.q[number, rows]))

    @property
    def _root(self) -> str:
        return f"step_{self.step.sample}"

    @cached_property
    def _legend(self) -> Legend:
        cell = self._drawing.workcell
        behind = [  # individuals outside the front of their generation
            normalised(np.delete(objectives, front, axis=0), objectives[front]) if len(front) else objectives
            for objectives, front in zip(self.step.objectives, self.step.fronts, strict=True)
        ]
        entries = drawn_entries(
            ("population", SCREEN.population, any(map(self._scatter.shows_any, behind))),
            ("front of the generation", SCREEN.front, True),
            ("chosen by the weights, or the individual looked at", SCREEN.chosen, True),
            ("its arm", SCREEN.arm, True),
            ("arms of the front", SCREEN.ghost, self._shows_arms),
            ("path to follow", SCREEN.target, cell.paths),
            ("where the tool is to be", SCREEN.path, True),
            ("obstacle", SCREEN.obstacle, cell.obstacles),
        )
        return Legend(entity=f"{self._root}/legend", entries=entries)

    @cached_property
    def _shows_arms(self) -> bool:
        """Whether in any generation an arm of the front is visible next to the chosen one."""
        numbers = range(len(self.step.fronts))
        return is_seen_beside(self._drawing, max(map(self._distance, numbers), default=0.0))

    def _distance(self, number: int) -> float:
        """Return the largest distance of nodes of a front's arms from the chosen arm [m]."""
        front = self.step.fronts[number]
        if not len(front):
            return 0.0
        chosen = self._links(number, self.step.chosen[number : number + 1])
        return float(np.linalg.norm(self._links(number, front) - chosen, axis=-1).max())

    @cached_property
    def _scatter(self) -> Scatter:
        alive = np.isfinite(self.step.objectives).all(axis=2)
        return Scatter(scene=self.loop, shown=self.step.objectives[alive], root=(self._root,))

    @cached_property
    def _drawing(self) -> ArmDrawing:
        cell = self.loop.workcell or Workcell(arm=self.step.arm)
        shown = [self._links(number, front).reshape(-1, 3) for number, front in enumerate(self.step.fronts)]
        nodes = np.concatenate([*shown, self.step.target[None]])
        return ArmDrawing(entity=f"{self._root}/arm", workcell=cell, nodes=nodes)


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopDrawing:
    """A closed loop, whose steps are its ``messages``, and its ``end``; ``note``: what was left out."""

    scene: SearchedFront
    messages: Sequence[Generation]
    end: SearchEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._scatter.log_axes(stream)
        for drawn in (*self._charts, self._motions):
            if drawn is not None:
                drawn.log(stream)
        first = self.messages[0].number if self.messages else 0
        if first:  # explain at step 0 why it has no front, next to its picture and in it
            set_times(stream, **self._times(0))
            words = "The arm stands where it begins: nothing was searched for, so there is no front."
            log_text(stream, f"# Step 0\n\n{words} The first is that of step {first}.")
            for chart in self._charts:
                chart.log_cursor(stream, float(first))
            self._scatter.log_note(stream, f"no front before step {first}")
            set_times(stream, **self._times(first))
            self._scatter.log_note(stream, "")
        for generation in self.messages:
            set_times(stream, **self._times(generation.number))
            self._log_step(stream, generation)
        point, motions = self._point, self._motions
        if motions is not None and point is not None and point.motion is not None:
            # the arm moves one sample per step; before the first sample it is at its start
            times = point.motion.time
            columns = [rr.TimeColumn("motion", duration=times), rr.TimeColumn("step", sequence=np.arange(len(times)))]
            set_times(stream, **self._times(0))
            motions.log_whole(stream, [point], row=0)
            if self._searches and self._opening is not None:
                set_times(stream, generation=0, individual=0)
                motions.log_whole(stream, [point], row=self._opening.number)
            stream.reset_time()
            motions.send(stream, point, columns, point.motion.q, times)
            motions.send_series(stream, point, columns)
        if self._searches and self.messages:
            set_times(stream, generation=0, individual=0)  # of searched steps: the loop does not move meanwhile
            tabs = " and ".join(f"\u201csearch of step {each.step.sample}\u201d" for each in self._searches)
            hint = f"**This timeline moves {tabs}: open that tab above the legend.**"
            self._log_step(stream, self._opening or self.messages[-1], hint)
        for each in self._searches:
            times_of_motion = {name: time for name, time in self._times(each.step.sample).items() if name != "step"}
            each.log(stream, times_of_motion)
        motions, opening = self._motions, self._opening
        Layout(
            legend=Legend(entries=search_entries(self.scene, motions, chosen="chosen")),
            front=self._scatter.view(),
            charts=[chart.view() for chart in self._charts],
            texts=[text_view("step")],
            note=self.note,
            timeline="step",
            start=None if opening is None else opening.number,
            end=self.messages[-1].number if self.messages else 0,
            name="loop",
            further=[each.view() for each in self._searches],
            **motion_views(motions),
        ).log(stream)

    def _times(self, step: int) -> dict[str, float]:
        """Return the time of a step, and its end [s] on the timeline of the motion, if there is one."""
        motion = None if self._point is None else self._point.motion
        return {"step": step} | ({} if motion is None else {"motion": float(motion.time[step])})

    def _log_step(self, stream: rr.RecordingStream, generation: Generation, hint: str = "") -> None:
        """Draw a step at the current time with its text, which begins with a hint."""
        choice, opening = self.end.choice, None if self._opening is None else self._opening.number
        words = [hint, step_text(self.scene, generation)]
        if choice is not None:
            words.append(f"## The whole loop\n\n{screen_text(choice.reason)}")
        words.append(loop_guide([each.step.sample for each in self._searches], opening))
        log_generation(stream, self._scatter, self._charts, generation, "\n\n".join(filter(None, words)))

    @cached_property
    def _opening(self) -> Generation | None:
        """The step that the recording opens on: the first with a recorded search, or the one with the widest front."""
        recorded = {each.sample for each in self.end.searched}
        steps = [each for each in self.messages if each.number in recorded]
        # the widest front has the largest product of ranges among those in which every objective varies
        varying = [each for each in self.messages if len(each.front) and np.ptp(each.front, axis=0).all()]
        if steps or not varying:
            return steps[0] if steps else None
        return max(varying, key=lambda each: float(np.log(np.ptp(each.front, axis=0)).sum()))

    @cached_property
    def _point(self) -> RecordedPoint | None:
        return None if self.end.choice is None else chosen_point(self.end.choice)

    @cached_property
    def _motions(self) -> MotionScene | None:
        cell = self.scene.workcell
        if cell is None or self._point is None or self._point.motion is None:
            return None
        return MotionScene(workcell=cell, names=self.scene.names, points=[self._point])

    @cached_property
    def _searches(self) -> list[StepScene]:
        return [StepScene(loop=self.scene, step=each) for each in self.end.searched]

    @cached_property
    def _scatter(self) -> Scatter:
        fronts = [np.empty((0, len(self.scene.names))), *(each.front for each in self.messages)]
        return Scatter(scene=self.scene, shown=np.concatenate(fronts))

    @cached_property
    def _charts(self) -> list[Chart]:
        return search_charts(self.scene, self.messages)
