"""A chosen motion, or two beside each other, as a layer over the recording of a run.

It has a layout of its own, in which the recording's views are a second tab.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Times
from paretoik.front.front import Choice, Front
from paretoik.front.prediction import Prediction
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import choice_entries
from paretoik.review.drawing.motion_scene import NO_TIMES, MotionScene
from paretoik.review.drawing.parallel_axes import ParallelAxes
from paretoik.review.drawing.point_text import choice_text
from paretoik.review.drawing.recorded_views import ROOTS, RecordedRun
from paretoik.review.drawing.recording_layout import choice_blueprint
from paretoik.review.drawing.replay_clock import is_moving
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.drawing_options import VIEWS
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorded_end import chosen_point
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.workcell import Workcell, workcell_of_front


@dataclass(frozen=True, kw_only=True, eq=False)
class ChoiceLayer:
    """One choice of a front, or two, with their motions on the timeline ``motion``.

    On all others of the ``recorded`` run, if there is one, the arms stand still. ``names`` are what the choices are
    called, by default points with their ids. Axes hold the motions of points ``around`` them, too. The layout is for a
    viewer so many pixels wide, ``width``. Where it ``predicts``, the legend says how predictions are drawn.
    """

    front: Front
    choices: tuple[Choice, ...]
    recorded: RecordedRun | None = None
    names: tuple[str, ...] = ()
    around: tuple[RecordedPoint, ...] = ()
    width: float = VIEWS.width
    predicts: bool = False

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw the front with the choices, what is to be known of them, and their arms."""
        self.log_front(stream)
        self.log_choices(stream)

    def log_front(self, stream: rr.RecordingStream) -> None:
        """Draw the front on its axes, for all times."""
        self._legend.log(stream)
        self.scene.log_axes(stream, self._canvases, static=True)
        front = self.front
        self.scene.log_points(stream, "front", front.objectives, self._canvases, ids=front.ids, named=True, static=True)
        if self._parallel is not None:
            self._parallel.log(stream, static=True)
            stream.log(
                f"{self._parallel.entity}/front",
                self._parallel.lines(front.objectives, SCREEN.front, 0.6, 1.0),
                static=True,
            )

    def log_choices(self, stream: rr.RecordingStream, times: Times = NO_TIMES) -> None:
        """Draw the choices, for all times, and their arms along their motions, at ``times`` too.

        Where that was done before with other choices of the layer, what is drawn now takes their place.
        """
        for root, choice, point, motions in zip(ROOTS, self.choices, self._points, self._motions, strict=False):
            self.scene.log_points(
                stream,
                root,
                choice.objectives[None],
                self._canvases,
                ids=np.array([choice.id]),
                named=True,
                static=True,
                avoided=self.front.objectives,
            )
            if self._parallel is not None:
                colour = SCREEN.chosen if root == ROOTS[0] else SCREEN.compared
                lines = self._parallel.lines(choice.objectives[None], colour, 2.2, 4.0)
                stream.log(f"{self._parallel.entity}/{root}", lines, static=True)
            words = choice_text(self.front, choice, title="chosen" if root == ROOTS[0] else "compared")
            stream.log(f"{root}/text", rr.TextDocument(words, media_type="text/markdown"), static=True)
            if motions is not None and point.motion is not None:
                self._log_motion(stream, motions, point, times)

    def log_prediction(self, stream: rr.RecordingStream, prediction: Prediction | None) -> None:
        """Draw where a move is expected to lead, for all times, in grey; None removes it."""
        F = np.zeros((0, len(self.front.names))) if prediction is None else prediction.objectives[None]
        self.scene.log_points(stream, "predicted", F, self._canvases, static=True)
        if self._parallel is not None:
            lines = self._parallel.lines(F, SCREEN.predicted, 2.0, 3.0)
            stream.log(f"{self._parallel.entity}/predicted", lines, static=True)
        if self._motions[0] is not None:
            motion = None if prediction is None else record_motion(prediction.motion, curves=False)
            self._motions[0].log_predicted(stream, motion)

    def _log_motion(self, stream: rr.RecordingStream, motions: MotionScene, point: RecordedPoint, times: Times) -> None:
        """Let the arm of a point move, and stand still on the recording's timelines."""
        assert point.motion is not None
        motions.log(stream)
        begins = {} if self.recorded is None else {name: each.first for name, each in self.recorded.timelines.items()}
        for timeline, first in ({self._timeline: {"duration": 0.0}} | begins).items():
            stream.set_time(timeline, **first)
        motions.log_whole(stream, [point])
        stream.reset_time()
        motions.send_motion(stream, point, times)

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout, with the views of the recorded run, if there is one, as a second tab."""
        arms = [
            (motions.view(), [chart.view() for chart in motions.charts.values()])
            for motions in self._motions
            if motions is not None
        ]
        texts = [
            rrb.TextDocumentView(origin=f"{root}/text", name=name)
            for root, name in zip(ROOTS, self._names, strict=False)
        ]
        below: list[rrb.View] = [] if self._parallel is None else [self._parallel.view()]
        front = self.scene.view() if self._canvases else None
        name = " beside ".join(self._names)
        tab = None if self.recorded is None else self.recorded.tab()
        narrow = self.width < VIEWS.width
        return choice_blueprint(
            self._legend,
            front,
            below,
            arms,
            texts,
            name=name,
            recorded=tab,
            narrow=narrow,
            timeline=self._timeline,
        )

    @property
    def _timeline(self) -> str:
        """The timeline that plays: that of the motion, of arms that stand still that of the recorded run."""
        stands = self.recorded is not None and not is_moving(self._points)
        return self.recorded.timeline if stands and self.recorded is not None else "motion"

    @property
    def scene(self) -> SearchScene:
        """How the front is drawn."""
        front = self.front
        return SearchScene(
            names=tuple(front.names), units=tuple(front.units), maximised=tuple(front.maximised), root=(ROOTS[0],)
        )

    @cached_property
    def _canvases(self) -> list[Canvas]:
        return self.scene.canvases(self.front.objectives)

    @cached_property
    def _parallel(self) -> ParallelAxes | None:
        return self.scene.parallel_axes(self.front.objectives)

    @cached_property
    def _points(self) -> list[RecordedPoint]:
        return [chosen_point(choice) for choice in self.choices]

    @cached_property
    def _motions(self) -> list[MotionScene | None]:
        """The arms of the choices, on the same axes; None without a workcell or motions."""
        cell = workcell_of_front(self.front)
        if cell is None or any(point.motion is None for point in self._points):
            return [None] * len(self.choices)
        return [self._scene_of(cell, number) for number in range(len(self.choices))]

    def _scene_of(self, cell: Workcell, number: int) -> MotionScene:
        return MotionScene(
            workcell=cell,
            names=tuple(self.front.names),
            points=[*self._points, *self.around],
            title=self._names[number],
            root=f"{ROOTS[number]}/",
        )

    @property
    def _legend(self) -> Legend:
        motions = next((each for each in self._motions if each is not None), None)
        return Legend(
            entity=f"{ROOTS[0]}/legend",
            entries=choice_entries(self._names, motions, predicts=self.predicts),
            width=self.width,
        )

    @property
    def _names(self) -> tuple[str, ...]:
        return self.names or tuple(f"point {choice.id}" for choice in self.choices)
