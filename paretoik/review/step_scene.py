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

from paretoik.review.arm_drawing import ArmDrawing
from paretoik.review.palette import SCREEN
from paretoik.review.recorder import SearchedStep
from paretoik.review.search_scene import SearchScene, replay_window
from paretoik.robot.kinematics import link_nodes


@dataclass(frozen=True, kw_only=True, eq=False)
class StepScene:
    """The search of one step of a closed loop, whose objectives ``loop`` names."""

    loop: SearchScene
    step: SearchedStep

    def view(self) -> rrb.Container:
        """Return the views: the fronts, and beside them the arm."""
        panels = rrb.Grid(*self._scene.views(self._canvases), grid_columns=self._scene.columns)
        name = f"search of step {self.step.sample}"
        return rrb.Horizontal(panels, self._drawing.view(f"arms of the front, step {self.step.sample}"), name=name)

    def log(self, recording: rr.RecordingStream, end: Mapping[str, float]) -> None:
        """Log the search; its last generation also stands at the ``end`` of the step on other timelines, by name."""
        self._scene.log_axes(recording, self._canvases, static=True)
        self._drawing.log_axes(recording)
        last = len(self.step.objectives) - 1
        for number in range(last + 1):
            recording.reset_time()
            recording.set_time("generation", sequence=number)
            self._log_generation(recording, number)
        recording.reset_time()
        recording.set_time("step", sequence=self.step.sample)
        for timeline, seconds in end.items():
            recording.set_time(timeline, duration=seconds)
        self._log_generation(recording, last)
        alive = np.flatnonzero(np.isfinite(self.step.objectives[last]).all(axis=1))
        order = alive[np.argsort(self.step.objectives[last, alive, 0], kind="stable")]
        for place, individual in enumerate(order):
            recording.reset_time()
            recording.set_time("individual", sequence=place)
            if place == 0:
                self._log_generation(recording, last)
            self._log_individual(recording, last, int(individual))
        recording.reset_time()

    def _log_generation(self, recording: rr.RecordingStream, number: int) -> None:
        """Draw a generation at the current time: its population and front, and the arms of the front."""
        objectives, front = self.step.objectives[number], self.step.fronts[number]
        alive = np.isfinite(objectives).all(axis=1)
        scene, canvases, drawing = self._scene, self._canvases, self._drawing
        scene.log_points(recording, "population", objectives[alive], canvases)
        scene.log_points(recording, "front", objectives[front], canvases, ids=front, named=True)
        strips, points = drawing.archetypes
        thin, dot = rr.Radius.ui_points(1.0), rr.Radius.ui_points(5.0)
        ghosts = strips(
            drawing.place(self._links(number, front)),
            colors=SCREEN.ghost,
            radii=thin,
            labels=[f"point {individual}" for individual in front],
            show_labels=False,
            **drawing.order(0.0),
        )
        target = points(drawing.place(self.step.target[None]), colors=SCREEN.path, radii=dot, **drawing.order(1.0))
        recording.log(f"{drawing.entity}/front", ghosts)
        recording.log(f"{drawing.entity}/target", target)
        if len(front):
            self._log_individual(recording, number, int(self.step.chosen[number]))

    def _log_individual(self, recording: rr.RecordingStream, number: int, individual: int) -> None:
        """Draw one individual of a generation: its objectives and its arm."""
        drawing, row = self._drawing, np.array([individual])
        objectives = self.step.objectives[number, row]
        self._scene.log_points(recording, "chosen", objectives, self._canvases, ids=row, named=True)
        links = drawing.place(self._links(number, row))
        strips, points = drawing.archetypes
        rod, knot = rr.Radius.ui_points(3.5), rr.Radius.ui_points(5.0)
        colours = [SCREEN.arm] * (links.shape[1] - 1) + [SCREEN.tool]
        recording.log(f"{drawing.entity}/links", strips(links, colors=SCREEN.arm, radii=rod, **drawing.order(5.0)))
        recording.log(f"{drawing.entity}/joints", points(links[0], colors=colours, radii=knot, **drawing.order(6.0)))

    def _links(self, number: int, rows: Int[np.ndarray, " rows"]) -> Float[np.ndarray, "rows nodes 3"]:
        return np.asarray(link_nodes(self.step.arm, self.step.q[number, rows]))

    @property
    def _root(self) -> str:
        return f"step_{self.step.sample}"

    @cached_property
    def _scene(self) -> SearchScene:
        return replace(self.loop, timeline="generation", root=(self._root,))

    @cached_property
    def _canvases(self) -> list:  # type: ignore[type-arg]
        objectives, fronts = self.step.objectives, self.step.fronts
        return self._scene.canvases(
            replay_window([values[front] for values, front in zip(objectives, fronts, strict=True)])
        )

    @cached_property
    def _drawing(self) -> ArmDrawing:
        shown = [self._links(number, front) for number, front in enumerate(self.step.fronts)]
        nodes = np.concatenate([*(links.reshape(-1, 3) for links in shown), self.step.target[None]])
        return ArmDrawing(entity=f"{self._root}/arm", planar=self.step.arm.is_planar, nodes=nodes)
