"""How the search of one control step is drawn: its generations, and the arm of every individual of the last.

It stands on two timelines of its own, ``generation`` and ``individual``; on the others its last generation is there
from the end of its step on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int

from paretoik.review.drawing.arm_drawing import ArmDrawing
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.front_panels import normalised, outside_panels
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.point_text import NO_RANGE, outside_text, range_text
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.drawing.tool_target import is_seen_beside, target_mark
from paretoik.review.drawing_options import VIEWS
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorder import SearchedStep
from paretoik.review.recording.workcell import Workcell
from paretoik.review.run_words import counted
from paretoik.robot.kinematics import link_nodes

POPULATION, ARMS, PATH = "population", "arms of the front", "path to follow"
ENTRIES = (
    (POPULATION, SCREEN.population),
    ("front of the generation", SCREEN.front),
    ("chosen by the weights, or the individual looked at", SCREEN.chosen),
    ("its arm", SCREEN.arm),
    (ARMS, SCREEN.ghost),
    (PATH, SCREEN.target),
    ("where the tool is to be", SCREEN.path),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class StepScene:
    """The search of one step of a closed loop, whose objectives ``loop`` names, in a ``workcell``."""

    loop: SearchScene
    step: SearchedStep
    workcell: Workcell | None = None

    def view(self) -> rrb.Container:
        """Return the views: the fronts, and beside them the arm, below a legend."""
        arm = self._drawing.view(f"{ARMS if self._shows_arms else 'arm'}, step {self.step.sample}")
        text = rrb.TextDocumentView(origin=f"{self._root}/text", name="generation, individual")
        shown = [*([self._scene.view()] if self._canvases else []), arm, text]
        views = rrb.Horizontal(*shown, column_shares=VIEWS.columns[-len(shown) :])
        shares = [self._legend.height, VIEWS.body - self._legend.height]
        return rrb.Vertical(self._legend.view(), views, row_shares=shares, name=f"search of step {self.step.sample}")

    def log(self, recording: rr.RecordingStream, end: Mapping[str, float]) -> None:
        """Log the search; its last generation also stands at the ``end`` of the step on other timelines, by name."""
        self._legend.log(recording)
        self._scene.log_axes(recording, self._canvases, static=True)
        self._drawing.log_workcell(recording)
        last = len(self.step.objectives) - 1
        for number in range(last + 1):
            recording.reset_time()
            recording.set_time("generation", sequence=number)
            self._log_generation(recording, number)
        for place in (0, self.step.sample):  # from the loop's beginning on, so that the tab is never empty
            recording.reset_time()
            recording.set_time("step", sequence=place)
            for timeline, seconds in end.items():
                recording.set_time(timeline, duration=seconds if place else 0.0)
            self._log_generation(recording, last)
        alive = np.flatnonzero(np.isfinite(self.step.objectives[last]).all(axis=1))
        order = alive[np.argsort(self.step.objectives[last, alive, 0], kind="stable")]
        for place, individual in enumerate(order):
            recording.reset_time()
            recording.set_time("individual", sequence=place)
            if place == 0:
                self._log_generation(recording, last)
            self._log_individual(recording, last, int(individual))
            words = f"## Point {individual}, number {place + 1} of {len(order)} by {self.loop.names[0]}\n\n"
            words += "The weights choose it.\n\n" if individual == self.step.chosen[last] else ""
            self._log_text(recording, words + self._objectives(last, int(individual)))
        recording.reset_time()

    def _log_generation(self, recording: rr.RecordingStream, number: int) -> None:
        """Draw a generation at the current time: its population and front, and the arms of the front."""
        objectives, front = self.step.objectives[number], self.step.fronts[number]
        alive = np.isfinite(objectives).all(axis=1)
        self._log_text(recording, self._generation_text(number))
        scene, canvases, drawing = self._scene, self._canvases, self._drawing
        within = objectives[front] if len(front) else None
        scene.log_points(recording, "population", objectives[alive], canvases, reference=within)
        scene.log_points(recording, "front", objectives[front], canvases, ids=front, named=True, reference=within)
        named = {"labels": [f"point {individual}" for individual in front], "show_labels": False}
        ghosts = drawing.strips(list(self._links(number, front)), SCREEN.ghost, 1.0, 0.0, **named)
        recording.log(f"{drawing.entity}/front", ghosts)
        recording.log(f"{drawing.entity}/place", target_mark(drawing, self.step.target))
        if len(front):
            self._log_individual(recording, number, int(self.step.chosen[number]))

    def _log_individual(self, recording: rr.RecordingStream, number: int, individual: int) -> None:
        """Draw one individual of a generation: its objectives and its arm."""
        row = np.array([individual])
        objectives = self.step.objectives[number, row]
        front = self.step.objectives[number, self.step.fronts[number]]
        self._scene.log_points(
            recording,
            "chosen",
            objectives,
            self._canvases,
            ids=row,
            named=True,
            avoided=normalised(front, front),
            reference=front,
        )
        links = self._links(number, row)[0]
        self._drawing.log_arm(recording, "chosen", links, None)

    def _generation_text(self, number: int) -> str:
        """Return what is to be known of a generation, and of the individual that the weights choose."""
        objectives, front = self.step.objectives[number], self.step.fronts[number]
        alive = np.isfinite(objectives).all(axis=1)
        shown = normalised(objectives[alive], objectives[front]) if len(front) else objectives[alive]
        outside = outside_panels(self._scene.panels.pairs, self._canvases, shown)
        lines = [
            f"# Step {self.step.sample}, generation {number}",
            f"{counted(len(front), 'point')} on its front; of {counted(len(alive), 'individual')} "
            f"{(~alive).sum()} failed.",
            *outside_text(outside, int(alive.sum()), "the front"),
        ]
        if len(front) == 1:
            lines += ["", NO_RANGE]
        if len(front) > 1 and not is_seen_beside(self._drawing, distance := self._distance(number)):
            lines += ["", f"All arms of the front lie under the white one, at most {distance:.2g} m from it."]
        if len(front):
            low, high = objectives[front].min(axis=0), objectives[front].max(axis=0)
            ranges = zip(self.loop.names, low, high, self.loop.units, strict=True)
            lines += ["", "## Ranges of the front", ""]
            lines += [f"- **{name}**: {range_text(least, most, unit)}" for name, least, most, unit in ranges]
            lines += ["", "## Chosen by the weights", "", self._objectives(number, int(self.step.chosen[number]))]
        return "\n".join(lines)

    def _objectives(self, number: int, individual: int) -> str:
        values = self.step.objectives[number, individual]
        named = zip(self.loop.names, values, self.loop.units, strict=True)
        return "\n".join(f"- **{name}**: {value:.6g} {unit}".rstrip() for name, value, unit in named)

    def _log_text(self, recording: rr.RecordingStream, words: str) -> None:
        document = rr.TextDocument(screen_text(words), media_type="text/markdown")
        recording.log(f"{self._root}/text", document)

    def _links(self, number: int, rows: Int[np.ndarray, " rows"]) -> Float[np.ndarray, "rows nodes 3"]:
        return np.asarray(link_nodes(self.step.arm, self.step.q[number, rows]))

    @property
    def _root(self) -> str:
        return f"step_{self.step.sample}"

    @property
    def _legend(self) -> Legend:
        obstacles = [("obstacle", SCREEN.obstacle)] if self.workcell is not None and self.workcell.obstacles else []
        has_path = bool(self._drawing.workcell.paths)
        shows = {POPULATION: self._shows_population, ARMS: self._shows_arms, PATH: has_path}
        entries = [(words, colour) for words, colour in ENTRIES if shows.get(words, True)]
        return Legend(entity=f"{self._root}/legend", entries=[*entries, *obstacles])

    @cached_property
    def _shows_population(self) -> bool:
        """Whether any individual that is not on the front of its generation lies inside the axes."""
        panels = list(zip(self._scene.panels.pairs, self._canvases, strict=False))
        for objectives, front in zip(self.step.objectives, self.step.fronts, strict=True):
            others = np.delete(objectives, front, axis=0)
            shown = normalised(others, objectives[front]) if len(front) else others
            if any(canvas.shows(shown[:, list(pair)]).any() for pair, canvas in panels):
                return True
        return False

    @cached_property
    def _shows_arms(self) -> bool:
        """Whether in any generation an arm of the front is seen beside the chosen one."""
        numbers = range(len(self.step.fronts))
        return is_seen_beside(self._drawing, max(map(self._distance, numbers), default=0.0))

    def _distance(self, number: int) -> float:
        """Return how far nodes of the arms of a front are from those of the chosen one, at most [m]."""
        front = self.step.fronts[number]
        if not len(front):
            return 0.0
        chosen = self._links(number, self.step.chosen[number : number + 1])
        return float(np.linalg.norm(self._links(number, front) - chosen, axis=-1).max())

    @cached_property
    def _scene(self) -> SearchScene:
        return replace(self.loop, root=(self._root,))

    @cached_property
    def _canvases(self) -> list[Canvas]:
        alive = np.isfinite(self.step.objectives).all(axis=2)
        return self._scene.canvases(self.step.objectives[alive])

    @cached_property
    def _drawing(self) -> ArmDrawing:
        cell = Workcell(arm=self.step.arm) if self.workcell is None else self.workcell
        shown = [self._links(number, front) for number, front in enumerate(self.step.fronts)]
        nodes = np.concatenate([*(links.reshape(-1, 3) for links in shown), self.step.target[None]])
        return ArmDrawing(entity=f"{self._root}/arm", workcell=cell, nodes=nodes)
