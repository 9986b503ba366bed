"""The recording of directional maxima: the polygon grows, and the arm takes each maximising posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr

from paretoik.review.drawing.arm import ArmDrawing
from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart, LimitLine, fit_below_tabs
from paretoik.review.drawing.label_places import joined_labels, label_place
from paretoik.review.drawing.layout import Entry, Layout, Legend, log_text, text_view
from paretoik.review.drawing.motion import CHOSEN, limit_lines
from paretoik.review.drawing.space import Stage
from paretoik.review.palette import DRAWING, SCENES, SCREEN, Colour, joint_units
from paretoik.review.recording.messages import MaximaEnd, MaximaScene, in_space
from paretoik.review.words import run_text
from paretoik.robot.kinematics import link_nodes
from paretoik.task.limits import JOINT_UNITS


def maximum_text(scene: MaximaScene, end: MaximaEnd, number: int) -> str:
    """Return the text of the maximum along a direction, by its number from 1."""
    row, arm = number - 1, scene.workcell.arm
    value, direction = end.polygon.values[row], end.polygon.directions[row]
    lines = [
        f"# Direction {number} of {len(end.polygon)}",
        f"- along ({', '.join(f'{_without_dust(each, direction):.3g}' for each in direction)})",
    ]
    if len(direction) == 2:
        lines[-1] += f", {np.degrees(np.arctan2(direction[1], direction[0])) % 360:.4g}° from x"
    if not np.isfinite(value):
        return screen_text("\n".join([*lines, "- no posture was found that reaches it and can be held"]))
    best, worst = int(np.nanargmax(end.polygon.values)), int(np.nanargmin(end.polygon.values))
    least, most = end.polygon.values[worst], end.polygon.values[best]
    words = (
        f"- highest {scene.word} {value:.4g} {scene.unit}; of all directions {least:.4g} (direction {worst + 1}) to "
    )
    lines += [f"{words}{most:.4g} (direction {best + 1})", "", "## Joints", ""]
    for joint, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_types, strict=True)):
        position, speed, effort = ("m", "m/s", "N") if kind == "prismatic" else ("rad", "rad/s", "N m")
        torque = _without_dust(end.polygon.torque[row, joint], end.polygon.torque)
        words = (
            f"- **{name}**: {end.polygon.q[row, joint]:.4g} {position}, {'force' if kind == 'prismatic' else 'torque'} "
        )
        words += f"{torque:.3g} {effort}"
        unit = speed if scene.quantity == "velocity" else effort
        if scene.quantity == "velocity":
            words += f", {_without_dust(end.polygon.dq[row, joint], end.polygon.dq):.4g} {speed}"
        low, high = end.lower[row, joint], end.upper[row, joint]
        lines.append(f"{words}; motors allow {low:.3g} to {high:.3g} {unit}")
    if end.polygon.sliders is not None:
        lines += ["", "## Sliders", ""]
        lines += [
            f"- **{name}**: its front slider at {1e3 * end.polygon.sliders[row, 0, joint]:.4g} mm, its back slider at "
            f"{1e3 * end.polygon.sliders[row, 1, joint]:.4g} mm"
            for joint, name in enumerate(arm.joint_names)
        ]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _without_dust(value: float, all_values: np.ndarray) -> float:
    """Return a value, or 0 if it is only rounding compared with the largest of all."""
    return 0.0 if abs(value) <= DRAWING.rounding * float(np.nanmax(np.abs(all_values))) else float(value)


ENTITY = "maxima"


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaDrawing:
    """Directional maxima on the timeline ``direction``, from 1 on; ``note``: what was left out."""

    scene: MaximaScene
    messages: Sequence[object]
    end: MaximaEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        count, stage, end, drawing = len(self.end.polygon), self._stage, self.end, self._drawing
        stage.log_axes(stream)
        final = self._outline(count, SCREEN.final, 0.8, 0.5) if stage.planar else self._rays(count, SCREEN.final, 0.8)
        stream.log(f"{ENTITY}/final", final, static=True)  # all maxima, behind everything else
        stream.log(f"{ENTITY}/origin", stage.points(np.zeros((1, 3)), SCREEN.target, 4.0, 1.0), static=True)
        drawing.log_workcell(stream)
        for chart in self._charts:
            chart.log(stream)
        values = rr.AnyValues(
            values=end.polygon.values, directions=end.polygon.directions.ravel(), q=end.polygon.q.ravel()
        )
        stream.log("search/maxima", values, static=True)
        for number in range(1, count + 1):
            stream.set_time("direction", sequence=number)
            self._log_maxima(stream, number)
            # the arm in the posture of the direction, with the earlier postures behind it
            is_reached = np.isfinite(end.polygon.values[:number])
            before = list(self._links[: number - 1][is_reached[:-1]])
            stream.log(f"{drawing.entity}/postures", drawing.stage.strips(before, SCREEN.ghost, 1.0, 0.0))
            arrow = np.stack([self._place, self._arrow_ends[number - 1]])
            stream.log(f"{drawing.entity}/direction/line", drawing.stage.strips([arrow], SCREEN.chosen, 2.0, 9.0))
            stream.log(f"{drawing.entity}/direction/head", drawing.stage.points(arrow[1:], SCREEN.chosen, 4.5, 9.0))
            if not is_reached[-1]:
                stream.log(f"{drawing.entity}/{CHOSEN}", rr.Clear(recursive=True))
            else:
                drawing.log_arm(stream, CHOSEN, self._links[number - 1], None)
                if drawing.meshes is not None:
                    drawing.meshes.log_posture(stream, end.polygon.q[number - 1])
            log_text(stream, maximum_text(self.scene, self.end, number))
            for chart in self._charts:
                chart.log_cursor(stream, float(number))
        stream.reset_time()
        self._layout.log(stream)

    def _log_maxima(self, stream: rr.RecordingStream, count: int) -> None:
        """Draw the first ``count`` maxima; the last one is chosen, and its name avoids rays and corners."""
        tips, stage, words = self._tips[:count], self._stage, f"direction {count}"
        is_reached = np.isfinite(tips).all(axis=1)
        stream.log(f"{ENTITY}/rays", self._rays(count, SCREEN.front, 0.6))
        stream.log(f"{ENTITY}/outline", self._outline(count, SCREEN.front, 1.6, 2.0))
        names = [f"direction {number}" for number in np.flatnonzero(is_reached) + 1]
        corners = stage.points(tips[is_reached], SCREEN.front, 3.2, 3.0, labels=names, show_labels=False)
        stream.log(f"{ENTITY}/corners", corners)
        chosen = tips[count - 1 : count][is_reached[-1:]]
        arrow = [np.stack([np.zeros(3), tip]) for tip in chosen]
        stream.log(f"{ENTITY}/chosen/ray", stage.strips(arrow, SCREEN.chosen, 2.0, 4.0))
        stream.log(f"{ENTITY}/chosen/tip", stage.points(chosen, SCREEN.chosen, 6.0, 5.0))
        said = [words] * len(chosen)
        name = [stage.points(1.12 * chosen, SCREEN.chosen, 0.0, 0.0, labels=said, show_labels=True)]
        if stage.planar:
            shares = np.linspace(0.0, 1.0, 12)[:, None, None]
            rays = stage.place((shares * self._tips[np.isfinite(self._tips).all(axis=1)]).reshape(-1, 3))
            marks = stage.place(chosen)
            middles = [label_place(stage.canvas, mark, words, rays) for mark in marks]
            name = [*joined_labels(marks, middles, said, SCREEN.chosen)]
        stream.log(f"{ENTITY}/chosen/name", *name)

    def _rays(self, count: int, colour: Colour, radius: float) -> Any:
        rays = [np.stack([np.zeros(3), tip]) for tip in self._tips[:count] if np.isfinite(tip).all()]
        return self._stage.strips(rays, colour, radius, 0.8)

    def _outline(self, count: int, colour: Colour, radius: float, order: float) -> Any:
        """Return the polygon through the first ``count`` maxima, closed if these are all maxima; no line in space."""
        tips = self._tips[:count]
        tips = tips[np.isfinite(tips).all(axis=1)]
        if not self._stage.planar or len(tips) < 2:
            return self._stage.strips([], colour, radius, order)
        if count == len(self.end.polygon) and len(tips) > 2:
            around = np.argsort(np.arctan2(tips[:, 1], tips[:, 0]), kind="stable")
            tips = tips[np.append(around, around[0])]
        return self._stage.strips([tips], colour, radius, order)

    @cached_property
    def _tips(self) -> np.ndarray:
        """The maxima as vectors (directions, 3), NaN if none was found."""
        return in_space(self.end.polygon.values[:, None] * self.end.polygon.directions)

    @cached_property
    def _stage(self) -> Stage:
        """The plane or space of the maxima."""
        planar = self.end.polygon.directions.shape[1] == 2
        along = f"{self.scene.word} along " if planar else ""  # in space short labels stay visible
        x, y, z = (f"{along}{axis} [{self.scene.unit}]" for axis in "xyz")
        seen = np.concatenate([np.zeros((1, 3)), self._tips[np.isfinite(self._tips).all(axis=1)]])
        if planar and len(seen) == 1:
            seen = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])
        return Stage(entity=ENTITY, planar=planar, seen=seen, labels=(x, y, z))

    @cached_property
    def _links(self) -> np.ndarray:
        return np.asarray(link_nodes(self.scene.workcell.arm, self.end.polygon.q))

    @property
    def _place(self) -> np.ndarray:
        """The position of the tool [m]."""
        return next(iter(self.scene.workcell.places.values()))

    @cached_property
    def _arrow_ends(self) -> np.ndarray:
        reach = float(np.nanmax(np.ptp(self._links, axis=(0, 1))))
        return np.asarray(self._place + SCENES.arrow * reach * in_space(self.end.polygon.directions))

    @cached_property
    def _drawing(self) -> ArmDrawing:
        nodes = self._links[np.isfinite(self.end.polygon.values)].reshape(-1, 3)
        return ArmDrawing(entity="arm", workcell=self.scene.workcell, nodes=np.concatenate([nodes, self._arrow_ends]))

    @cached_property
    def _charts(self) -> list[Chart]:
        """The charts over the directions: the maxima, then joints and motors."""
        end, cell, arm, numbers = (
            self.end,
            self.scene.workcell,
            self.scene.workcell.arm,
            np.arange(1.0, len(self.end.polygon) + 1),
        )
        speed, joints = self.scene.quantity == "velocity", arm.joint_names
        labels = {kind: f"joint {kind} [{joint_units(arm, JOINT_UNITS[kind])}]" for kind in JOINT_UNITS}
        ends = np.array([1.0, float(max(len(end.polygon), 2))])
        limits = [
            replace(each, instants=ends, values=each.values[[0, -1]]) for each in limit_lines(cell, "position", 1.0)
        ]
        capability = [  # the joint limits that the motors allow, over the directions
            LimitLine(instants=numbers, values=values[:, joint], name=name, colours=[SCREEN.joint(joint)])
            for joint, name in enumerate(joints)
            for values in (end.lower, end.upper)
        ]
        label = f"highest {self.scene.word} [{self.scene.unit}]"
        shown: list[tuple[str, str, Any, Sequence[str], Sequence[LimitLine]]] = [
            ("maximum", label, end.polygon.values[:, None], [self.scene.word], []),
            ("position", labels["position"], end.polygon.q, joints, limits),
            *([("velocity", labels["velocity"], end.polygon.dq, joints, capability)] if speed else []),
            ("torque", labels["torque"], end.polygon.torque, joints, [] if speed else capability),
        ]
        if end.polygon.sliders is not None:
            places = [f"{side} {name}" for side in ("front", "back") for name in joints]
            shown.append(("sliders", "slider position [m]", end.polygon.sliders, places, []))
            shown.append(("motor_speeds", "motor speed [m/s]", end.polygon.motor_speeds, places, []))
            shown.append(("motor_efforts", "motor force [N]", end.polygon.motor_efforts, places, []))
        charts = []
        for name, label, values, names, lines in shown:
            colours, more = [SCREEN.joint(number) for number in range(len(names))], {"names": names, "limits": lines}
            curves = values.reshape(len(end.polygon), -1).T
            charts.append(Chart.over("direction", name, label, numbers, curves, colours, dots=True, **more))
        return [charts[0], *fit_below_tabs(charts[1:])]

    @property
    def _layout(self) -> Layout:
        charts, cell = [chart.view() for chart in self._charts], self.scene.workcell
        entries: list[Entry] = [
            (f"highest {self.scene.word}s so far", SCREEN.front),
            ("this direction", SCREEN.chosen),
            ("all directions", SCREEN.final),
            ("arm in the posture of this direction", SCREEN.arm),
            ("postures of those before", SCREEN.ghost),
            ("position of the tool", SCREEN.target),
            ("what motors allow: dashed", SCREEN.text),
        ]
        entries += [("limits: dashed", SCREEN.text)] if "position" in cell.bounds else []
        entries += [("obstacle", SCREEN.obstacle)] if cell.obstacles else []
        return Layout(
            legend=Legend(entries=entries),
            front=self._stage.view(f"highest {self.scene.word} in each direction"),
            charts=charts[:1],
            arm=self._drawing.view("arm in the posture of the maximum"),
            joints=charts[1:],
            texts=[text_view("direction")],
            timeline="direction",
            name="directional maxima",
            frames=DRAWING.slow_frames,
            note=self.note,
        )
