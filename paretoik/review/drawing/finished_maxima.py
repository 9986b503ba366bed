"""The recording of directional maxima: the polygon grows, and the arm stands in each maximising posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.arm_drawing import ArmDrawing
from paretoik.review.drawing.curve_charts import Chart, LimitLine
from paretoik.review.drawing.joint_charts import limit_lines
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import maxima_entries
from paretoik.review.drawing.maxima_panel import MaximaPanel
from paretoik.review.drawing.maxima_text import maximum_text
from paretoik.review.drawing.motion_scene import CHOSEN
from paretoik.review.drawing.recording_layout import TEXT, Layout, note_view, text_view
from paretoik.review.drawing.search_charts import DrawnChart, fit_drawn_charts
from paretoik.review.drawing_options import DRAWING, SCENES
from paretoik.review.joint_units import joint_units
from paretoik.review.palette import SCREEN
from paretoik.review.recording.measured_maxima import MaximaEnd, MaximaScene
from paretoik.robot.kinematics import link_nodes
from paretoik.task.limits import JOINT_UNITS


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedMaxima:
    """Directional maxima on the timeline ``direction``, from 1 on; ``note`` says what was left out."""

    scene: MaximaScene
    messages: Sequence[object]
    end: MaximaEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._layout.legend.log(stream)
        self._panel.log(stream)
        self._drawing.log_workcell(stream)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self.note:
            stream.log("notes/left_out", rr.TextDocument(self.note), static=True)
        stream.log(
            "search/maxima",
            rr.AnyValues(values=self.end.values, directions=self.end.directions.ravel(), q=self.end.q.ravel()),
            static=True,
        )
        for number in range(1, len(self.end) + 1):
            stream.set_time("direction", sequence=number)
            self._log_direction(stream, number)
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_direction(self, stream: rr.RecordingStream, number: int) -> None:
        """Draw the maximum along a direction, by its number, behind it those before it."""
        self._panel.log_until(stream, number)
        words = maximum_text(self.scene, self.end, number)
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(number))
        drawing, is_reached = self._drawing, np.isfinite(self.end.values[:number])
        before = self._links[: number - 1][is_reached[:-1]]
        stream.log(f"{drawing.entity}/postures", drawing.strips(list(before), SCREEN.ghost, 1.0, 0.0))
        arrow = np.stack([self._place, self._arrow_ends[number - 1]])
        stream.log(f"{drawing.entity}/direction/line", drawing.strips([arrow], SCREEN.chosen, 2.0, 9.0))
        stream.log(f"{drawing.entity}/direction/head", drawing.points(arrow[1:], SCREEN.chosen, 4.5, 9.0))
        if is_reached[-1]:
            drawing.log_arm(stream, CHOSEN, self._links[number - 1], None)
            if drawing.meshes is not None:
                drawing.meshes.log_posture(stream, self.end.q[number - 1])
        else:
            stream.log(f"{drawing.entity}/{CHOSEN}", rr.Clear(recursive=True))

    @cached_property
    def _panel(self) -> MaximaPanel:
        return MaximaPanel(scene=self.scene, end=self.end)

    @cached_property
    def _links(self) -> np.ndarray:
        return np.asarray(link_nodes(self.scene.workcell.arm, self.end.q))

    @property
    def _place(self) -> np.ndarray:
        """Where the tool is [m]."""
        return next(iter(self.scene.workcell.places.values()))

    @cached_property
    def _arrow_ends(self) -> np.ndarray:
        directions = np.pad(self.end.directions, ((0, 0), (0, 3 - self.end.directions.shape[1])))
        reach = float(np.nanmax(np.ptp(self._links, axis=(0, 1))))
        return np.asarray(self._place + SCENES.arrow * reach * directions)

    @cached_property
    def _drawing(self) -> ArmDrawing:
        nodes = self._links[np.isfinite(self.end.values)].reshape(-1, 3)
        return ArmDrawing(entity="arm", workcell=self.scene.workcell, nodes=np.concatenate([nodes, self._arrow_ends]))

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        """The maxima over the directions, then what joints and motors do in each."""
        end, cell, names = self.end, self.scene.workcell, self.scene.workcell.arm.joint_names
        label = f"highest {self.scene.word} [{self.scene.unit}]"
        charts = [self._chart("maximum", label, end.values[None], [self.scene.word])]
        ends = np.array([1.0, float(max(len(end), 2))])
        limits = [
            LimitLine(instants=ends, values=each.values[[0, -1]], name=each.name, colours=each.colours)
            for each in limit_lines(cell, "position", 1.0)
        ]
        charts.append(self._chart("position", self._joint_label("position"), end.q.T, names, limits))
        speed = self.scene.quantity == "velocity"
        if speed:
            charts.append(self._chart("velocity", self._joint_label("velocity"), end.dq.T, names, self._capability))
        of_torque = [] if speed else self._capability
        charts.append(self._chart("torque", self._joint_label("torque"), end.torque.T, names, of_torque))
        if end.sliders is not None:
            places = [f"{side} {name}" for side in ("front", "back") for name in names]
            flat = end.sliders.reshape(len(end), -1).T
            charts.append(self._chart("sliders", "slider position [m]", flat, places))
            charts.append(self._chart("motor_speeds", "motor speed [m/s]", _motors(end.motor_speeds), places))
            charts.append(self._chart("motor_efforts", "motor force [N]", _motors(end.motor_efforts), places))
        return [charts[0], *fit_drawn_charts(charts[1:])]

    @property
    def _capability(self) -> list[LimitLine]:
        """What the motors let each joint do, over the directions."""
        numbers = np.arange(1.0, len(self.end) + 1)
        return [
            LimitLine(instants=numbers, values=values[:, joint], name=name, colours=[SCREEN.joint(joint)])
            for joint, name in enumerate(self.scene.workcell.arm.joint_names)
            for values in (self.end.lower, self.end.upper)
        ]

    def _joint_label(self, kind: str) -> str:
        return f"joint {kind} [{joint_units(self.scene.workcell.arm, JOINT_UNITS[kind])}]"

    def _chart(
        self, name: str, label: str, curves: np.ndarray, names: Sequence[str], limits: Sequence[LimitLine] = ()
    ) -> DrawnChart:
        numbers = np.arange(1.0, len(self.end) + 1)
        chart = Chart(
            entity=f"charts/{name}",
            dots=True,
            title=label,
            labels=("direction", label),
            shown=np.stack([np.tile(numbers, len(curves)), curves.ravel()], axis=1),
            names=names,
            colours=[SCREEN.joint(number) for number in range(len(names))],
            limits=limits,
        )
        return chart, numbers, curves

    @cached_property
    def _layout(self) -> Layout:
        charts = [chart.view() for chart, _, _ in self._charts]
        notes: list[rrb.View] = [note_view()] if self.note else []
        return Layout(
            legend=Legend(entity="legend", entries=maxima_entries(self.scene.workcell, self.scene.word)),
            front=self._panel.view(),
            charts=charts[:1],
            arm=self._drawing.view("arm in the posture of the maximum"),
            joints=charts[1:],
            texts=[text_view("direction"), *notes],
            timeline="direction",
            name="directional maxima",
            frames=DRAWING.slow_frames,
        )


def _motors(values: np.ndarray) -> np.ndarray:
    """Return what motors do (directions, motors, dof) as curves (motors · dof, directions)."""
    return np.asarray(values.reshape(len(values), -1).T)
