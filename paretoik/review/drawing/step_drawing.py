"""Recordings of motions made step by step: resolved motions, and closed loops with their searches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int

from paretoik.review.drawing.arm import ArmDrawing, is_seen_beside, target_mark
from paretoik.review.drawing.axes import flat_dots, screen_text
from paretoik.review.drawing.charts import Chart, LimitLine, curve_points
from paretoik.review.drawing.layout import Entry, Layout, Legend, drawn_entries, log_text, set_times, text_view
from paretoik.review.drawing.motion import MotionScene, motion_views
from paretoik.review.drawing.point_text import NO_RANGE, broken_limits, outside_text, range_text, step_text
from paretoik.review.drawing.scatter import Scatter, normalised
from paretoik.review.drawing.search_drawing import log_generation, search_charts, search_entries
from paretoik.review.palette import DRAWING, SCREEN, VIEWS, even_rows
from paretoik.review.recording.messages import (
    RecordedPoint,
    RecordedTraces,
    ResolutionEnd,
    ResolvedScene,
    Workcell,
    chosen_point,
)
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchedStep, SearchEnd
from paretoik.review.words import counted, run_text
from paretoik.robot.kinematics import link_nodes

# Resolved motions: arms along their path, and the traces of their method over time.


STATUSES = {
    "done": "done, neither damped nor cut short",
    "damped": "damped, near a singularity",
    "shortened": "shortened: the full step would move a joint by more than 1 rad or 1 m",
    "held": "held: no joint velocities achieve the task",
    "limited": "limited: the task gives way to limits",
    "missed": "missed: the step does not end on the path",
}


def motion_text(scene: ResolvedScene, traces: RecordedTraces, end: ResolutionEnd) -> str:
    """Return the text of a motion: its errors, the limits it breaks, its steps, and its method."""
    worst = int(traces.error.argmax())
    lines = [
        f"# {scene.method}" + (f", {traces.name} ({traces.point.id + 1} of {end.count})" if end.count > 1 else ""),
        f"- largest error {traces.error[worst]:.3g} {scene.error_unit} at {traces.time[worst]:.3g} s; "
        f"the path counts as lost from {scene.tolerance:.3g} {scene.error_unit} on",
        f"- greatest joint speed, all joints together: {traces.speed.max():.4g} {scene.speed_unit} at "
        f"{traces.time[int(traces.speed.argmax()) + 1]:.3g} s",
    ]
    if traces.clearance is not None:
        nearest = int(traces.clearance.argmin())
        lines.append(f"- least clearance {traces.clearance[nearest]:.3g} m at {traces.time[nearest]:.3g} s")
    if reason := end.provenance.get("reason"):
        lines += ["", "## Why it ended", "", str(reason)]
    if scene.workcell.bounds and traces.point.motion is not None:
        broken = broken_limits(scene.workcell, traces.point.motion)
        lines += ["", "## Limits broken", "", *broken] if broken else ["", "Joint limits are satisfied at all samples."]
    lines += ["", "## Steps", ""]
    steps = Counter(traces.status.tolist())
    lines += [f"- {count} {STATUSES.get(status, status)}" for status, count in steps.most_common()]
    # the method's parameters; if they vary between motions, those of this motion
    units = {
        "damping": scene.damping_unit,
        "region": scene.damping_unit,
        "repulsion": scene.speed_unit,
        "buffer": "of a joint's range",
        "band": "of a criterion's range",
    }
    numbers = list[str]()
    for name, value in ((end.provenance.get("settings") or {}).get("method") or {}).items():
        if name == "name" or value in (None, []):
            continue
        by_motion = np.array(value if isinstance(value, list) else [], dtype=object).ravel()
        if end.count > 1 and len(by_motion) == end.count and all(isinstance(each, int | float) for each in by_motion):
            value = float(by_motion[traces.point.id])
        numbers.append(f"- {name.replace('_', ' ')}: {_value(value)} {units.get(name, '')}".rstrip())
    lines += ["", "## Method", "", *numbers] if numbers else []
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _value(value: object) -> str:
    """Return a setting in words; a criterion with its objective and gain."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {_value(each)}" for name, each in value.items())
    if isinstance(value, list):
        return ", ".join(_value(each) for each in value[:6]) + (", …" if len(value) > 6 else "")
    return f"{value:.5g}" if isinstance(value, float) and np.isfinite(value) else str(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolutionDrawing:
    """Resolved motions: the first one is solid, with some of the others next to it.

    On the timeline ``motion`` all of them move. If there are several, the timeline ``solution`` shows one after
    another.

    note: text on what was left out
    """

    scene: ResolvedScene
    messages: Sequence[object]
    end: ResolutionEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        first = self.end.motions[0]
        self._motions.log(stream)
        for chart in self._charts:
            chart.log(stream)
        set_times(stream, motion=0.0, **({"solution": 0} if len(self.end.motions) > 1 else {}))
        self._log_whole(stream, first, self._points)
        stream.reset_time()
        for point in self._points:
            self._motions.send_motion(stream, point, charts=self._all_charts)
        # while the arm moves: a text at each step whose status differs from the previous one
        words = motion_text(self.scene, first, self.end)
        changes = np.flatnonzero(first.status[1:] != first.status[:-1]) + 1
        for step in [*([0] if first.status[0] != "done" else []), *changes[: DRAWING.walk]]:
            set_times(stream, motion=float(first.time[step + 1] - first.time[0]))
            status = STATUSES.get(str(first.status[step]), str(first.status[step]))
            log_text(stream, screen_text(f"**From {first.time[step]:.4g} s on: {status}**") + f"\n\n{words}")
        for number, traces in enumerate(self.end.motions[1:], start=1):
            set_times(stream, solution=number)
            self._log_whole(stream, traces, [traces.point])
        motions, name = self._motions, self.end.motions[0].name
        named: list[Entry] = [(each.name, SCREEN.end(axis)) for axis, each in enumerate(self._thin_motions)]
        arm = f"arm of {name}, or of the motion looked at" if named else "arm"
        entries: list[Entry] = [
            *([(name, SCREEN.arm), *named] if named else []),
            ("step damped, shortened, held, limited or missed", SCREEN.event),
            ("error at which the path counts as lost: dashed", SCREEN.limit),
            *motions.entries(arm),
        ]
        recorded, count = len(self.end.motions), self.end.count
        words = f"{recorded} of {count} motions are shown." if recorded < count else ""
        Layout(
            legend=Legend(entries=entries),
            front=self._all_charts[0].view(),
            charts=[chart.view() for chart in self._all_charts[1:]],
            texts=[text_view("method")],
            timeline="motion",
            name=self.scene.method,
            frames=DRAWING.slow_frames,
            note=" ".join(filter(None, (self.note, words))),
            **motion_views(motions),
        ).log(stream)

    def _log_whole(self, stream: rr.RecordingStream, traces: RecordedTraces, points: Sequence[RecordedPoint]) -> None:
        """Draw a motion as the chosen one at the current time, with its text and criteria."""
        self._motions.log_whole(stream, points)
        log_text(stream, motion_text(self.scene, traces, self.end))
        if (chart := self._criteria_chart) is not None:
            chart.log(stream)
            chart.draw(stream, traces.time, np.stack([_steps(curve) for curve in traces.criteria.T]))
        chart, rows = self._charts[0], np.flatnonzero(traces.status != "done") + 1  # ends of steps that are not done
        places = np.stack([traces.time[rows], _logarithm(traces.error)[rows]], axis=1)
        stream.log(f"{chart.entity}/marks", flat_dots(chart.canvas.place(places), SCREEN.event, 3.0, 3.0))
        for chart in self._all_charts:
            chart.log_cursor(stream, float(traces.time[len(traces.time) // 2]))

    @cached_property
    def _thin_motions(self) -> list[RecordedTraces]:
        """Motions other than the first, evenly spread, at most one per colour."""
        others = list(self.end.motions[1:])
        return [others[place] for place in even_rows(len(others), len(SCREEN.ends))]

    @cached_property
    def _points(self) -> list[RecordedPoint]:
        """The first motion and the thin ones, as points whose ``axis`` gives their colour."""
        thin = [replace(each.point, axis=axis) for axis, each in enumerate(self._thin_motions)]
        return [self.end.motions[0].point, *thin]

    @cached_property
    def _motions(self) -> MotionScene:
        points = [*self._points, *(each.point for each in self.end.motions[1:])]
        names = tuple(each.name for each in self._thin_motions)
        return MotionScene(workcell=self.scene.workcell, names=names, points=points, prefix="")

    @cached_property
    def _charts(self) -> list[Chart]:
        """Charts with one curve per drawn motion; the task error is first."""
        scene, shown = self.scene, [self.end.motions[0], *self._thin_motions]
        time, several = shown[0].time, len(shown) > 1
        errors = f"log10 of the task error [{scene.error_unit}]", [_logarithm(each.error) for each in shown]
        curves: dict[str, tuple[str, list[np.ndarray]]] = {"error": errors}
        for name, label in (
            ("speed", f"commanded joint speed, all joints [{scene.speed_unit}]"),
            ("damping", f"damping [{scene.damping_unit}]"),
            ("repulsion", f"joint speed away from limits [{scene.speed_unit}]"),
        ):
            values = [_steps(getattr(each, name)) for each in shown]
            if name == "speed" or any(np.nanmax(np.abs(each), initial=0.0) > 0 for each in values):
                curves[name] = label, values
        if shown[0].clearance is not None:
            curves["clearance"] = "clearance [m]", [each.clearance for each in shown if each.clearance is not None]
        tolerance = float(np.log10(max(scene.tolerance, DRAWING.least_error)))
        limits = {"error": (tolerance, "tolerance" if several else ""), "clearance": (scene.min_clearance, "")}
        moving = np.stack([np.append(each[1:2], each[1:]) for each in curves["error"][1]])
        special = {"error": {"total": VIEWS.panels, "shown": curve_points(time, moving)}}  # no error at the start
        charts = []
        for name, (label, values) in curves.items():
            limit = [
                LimitLine(instants=time[[0, -1]], values=np.full(2, value), name=words, colours=[SCREEN.limit])
                for value, words in ([limits[name]] if name in limits else [])
            ]
            colours = [SCREEN.arm, *(SCREEN.end(axis) for axis in range(len(self._thin_motions)))]
            more = {"names": [each.name for each in shown], "limits": limit, **special.get(name, {})}
            charts.append(Chart.over("time [s]", name, label, time, np.stack(values), colours, **more))
        return charts

    @cached_property
    def _criteria_chart(self) -> Chart | None:
        """The chart of speeds due to each criterion, whose curves are those of one motion."""
        names, none = self.scene.criteria, np.zeros((0, 0))
        if not names:
            return None
        curves = [(each.time, _steps(curve)) for each in self.end.motions for curve in each.criteria.T]
        shown = np.concatenate([np.stack(each, axis=1) for each in curves])
        label, colours = f"speed from criteria [{self.scene.speed_unit}]", [SCREEN.joint(k) for k in range(len(names))]
        return Chart.over("time [s]", "criteria", label, np.zeros(0), none, colours, names=names, shown=shown)

    @property
    def _all_charts(self) -> list[Chart]:
        return self._charts if self._criteria_chart is None else [*self._charts, self._criteria_chart]


def _logarithm(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.log10(np.maximum(np.nan_to_num(errors, nan=0.0, posinf=1e16), DRAWING.least_error)))


def _steps(values: np.ndarray) -> np.ndarray:
    """Return values of steps at samples: at the end of each step, and the first also at its beginning."""
    return np.concatenate([values[:1], values])


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
        """Log the search; ``end``: end of the step on other timelines, by name [s].

        From this time on, those timelines show the last generation.
        """
        self._legend.log(recording)
        self._scatter.log_axes(recording)
        self._drawing.log_workcell(recording)
        last = len(self.step.objectives) - 1
        for number in range(last + 1):
            set_times(recording, generation=number)
            self._log_generation(recording, number)
        for place in (0, self.step.sample):  # also at the loop's beginning, so that the tab is never empty
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
            f"{counted(len(front), 'point')} on its front; {(~alive).sum()} of {counted(len(alive), 'individual')} "
            "failed.",
            *outside_text(self._scatter.outside(shown), int(alive.sum()), "the front"),
        ]
        if len(front) == 1:
            lines += ["", NO_RANGE]
        if len(front) > 1 and not is_seen_beside(drawing, distance := self._distance(number)):
            lines += ["", f"All arms of the front are below the white one, at most {distance:.2g} m from it."]
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
            (
                "population",
                SCREEN.population,
                any(panel.shows(F).any() for F in behind for panel in self._scatter.panels),
            ),
            ("front of the generation", SCREEN.front, True),
            ("chosen by the weights, or the individual looked at", SCREEN.chosen, True),
            ("its arm", SCREEN.arm, True),
            ("arms of the front", SCREEN.ghost, self._shows_arms),
            ("path to follow", SCREEN.target, cell.paths),
            ("target of the tool", SCREEN.path, True),
            ("obstacle", SCREEN.obstacle, cell.obstacles),
        )
        return Legend(entity=f"{self._root}/legend", entries=entries)

    @cached_property
    def _shows_arms(self) -> bool:
        """Whether an arm of any generation's front is visible next to the chosen one."""
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
            words = "The arm is at its start: nothing was searched yet, so there is no front."
            log_text(stream, f"# Step 0\n\n{words} The first front is that of step {first}.")
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
            set_times(stream, generation=0, individual=0)  # on these timelines the loop does not move
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
        """Return a step's number, and its end [s] on the timeline of the motion, if there is one."""
        motion = None if self._point is None else self._point.motion
        return {"step": step} | ({} if motion is None else {"motion": float(motion.time[step])})

    def _log_step(self, stream: rr.RecordingStream, generation: Generation, hint: str = "") -> None:
        """Draw a step at the current time with its text, which begins with a hint."""
        choice, opening = self.end.choice, 0 if self._opening is None else self._opening.number
        words = [hint, step_text(self.scene, generation)]
        if choice is not None:
            words.append(f"## The whole loop\n\n{screen_text(choice.reason)}")
        guide = [
            f"- The search of step {step} has a tab, \u201csearch of step {step}\u201d, above the legend. Only the "
            "timelines generation and individual move it."
            for step in (each.step.sample for each in self._searches)
        ]
        if opening:
            guide.append(
                f"- The steps from {opening} on, blue on the slider, are repeated; earlier ones are left of them. The "
                "loop button plays all steps."
            )
        if guide:
            words.append("## How to look at it\n\n" + "\n".join(guide))
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
