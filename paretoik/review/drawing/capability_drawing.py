"""The recordings of tool paths and of directional maxima: a moving tool, and a polygon that grows next to the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.arm import ArmDrawing
from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart, LimitLine, fit_below_tabs
from paretoik.review.drawing.label_places import joined_labels, label_place
from paretoik.review.drawing.layout import Layout, Legend, drawn_entries, log_text, set_times, text_view
from paretoik.review.drawing.motion import CHOSEN, limit_lines
from paretoik.review.drawing.space import Stage, fitting_eye
from paretoik.review.palette import DRAWING, SCENES, SCREEN, Colour, even_rows
from paretoik.review.recording.messages import MaximaEnd, MaximaScene, PathEnd, PathScene, in_space
from paretoik.review.words import run_text
from paretoik.robot.kinematics import link_nodes
from paretoik.task.limits import JOINT_UNITS, joint_units

PATH, MAXIMA = "path", "maxima"  # entities


@dataclass(frozen=True, kw_only=True, eq=False)
class PathDrawing:
    """A tool path on the timeline ``motion`` [s]; ``note``: what was left out."""

    scene: PathScene
    messages: Sequence[object]
    end: PathEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        stage, tool, end = self._stage, in_space(self.end.tool), self.end
        if stage.planar:
            stage.canvas.log(stream, PATH)
        if end.reference is not None:
            reference = stage.strips([in_space(end.reference)], SCREEN.target, 1.0, 20.0)
            stream.log(f"{PATH}/reference", reference, static=True)
        stream.log(f"{PATH}/line", stage.strips([tool], SCREEN.path, 1.0, 20.0), static=True)
        ends = in_space(np.stack([self.scene.start, self.scene.target]))
        stream.log(f"{PATH}/ends", stage.points(ends, SCREEN.text, 4.5, 3.0), static=True)
        speed = "speed", "tool speed [m/s]", end.middles, end.speed[None]
        distance = "distance", "distance to the target [m]", end.times, end.distance[None]
        charts = fit_below_tabs([Chart.over("time [s]", *each, [SCREEN.tool]) for each in (speed, distance)])
        for chart in charts:
            chart.log(stream)
        lines = [f"# {self.scene.title}", f"- {end.times[-1]:.6g} s, {len(end.times)} samples"]
        lines += [f"- ends {end.distance[-1]:.3g} m from the target", "", run_text(end.provenance)]
        log_text(stream, screen_text("\n".join(lines)), static=True)
        for row in even_rows(len(end.times), DRAWING.walk):
            set_times(stream, motion=float(end.times[row]))
            stream.log(f"{PATH}/tool", stage.points(tool[row, None], SCREEN.tool, 4.5, 3.0))
            for chart in charts:
                chart.log_cursor(stream, float(end.times[row]))
        entries = drawn_entries(
            ("path of the tool", SCREEN.path, True),
            ("tool", SCREEN.tool, True),
            ("start and target", SCREEN.text, True),
            ("reference", SCREEN.target, end.reference is not None),
        )
        view = stage.view(self.scene.title)
        if not stage.planar:  # without ground: the eye looks at the path only
            eye = fitting_eye(stage.seen)
            view = rrb.Spatial3DView(origin=PATH, name=view.name, background=SCREEN.background, eye_controls=eye)
        Layout(
            legend=Legend(entries=entries),
            front=view,
            charts=[chart.view() for chart in charts],
            texts=[text_view("run")],
            timeline="motion",
            name=self.scene.title,
        ).log(stream)

    @cached_property
    def _stage(self) -> Stage:
        """The plane or space of the path."""
        reference = self.end.tool[:0] if self.end.reference is None else self.end.reference
        seen = np.concatenate([self.end.tool, reference, self.scene.start[None], self.scene.target[None]])
        return Stage(entity=PATH, planar=seen.shape[1] == 2, seen=in_space(seen), margin=0.06)


def maximum_text(scene: MaximaScene, end: MaximaEnd, number: int) -> str:
    """Return the text of the maximum along a direction, by its number from 1."""
    row, arm, polygon, is_speed = number - 1, scene.workcell.arm, end.polygon, scene.quantity == "velocity"
    value, direction = polygon.values[row], polygon.directions[row]
    lines = [
        f"# Direction {number} of {len(polygon)}",
        f"- along ({', '.join(f'{_without_rounding(each, direction):.3g}' for each in direction)})",
    ]
    if len(direction) == 2:
        lines[-1] += f", {np.degrees(np.arctan2(direction[1], direction[0])) % 360:.4g}° from x"
    if not np.isfinite(value):
        return screen_text("\n".join([*lines, "- no posture was found that reaches the position and can be held"]))
    best, worst = int(np.nanargmax(polygon.values)), int(np.nanargmin(polygon.values))
    words = f"- highest {scene.word} {value:.4g} {scene.unit}; over all directions {polygon.values[worst]:.4g} "
    words += f"(direction {worst + 1}) to {polygon.values[best]:.4g} (direction {best + 1})"
    lines += [words, "", "## Joints", ""]
    for joint, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_types, strict=True)):
        slides = kind == "prismatic"
        position, speed, effort = (JOINT_UNITS[each][slides] for each in ("position", "velocity", "torque"))
        torque = _without_rounding(polygon.torque[row, joint], polygon.torque)
        words = f"- **{name}**: {polygon.q[row, joint]:.4g} {position}, {'force' if slides else 'torque'} "
        words += f"{torque:.3g} {effort}"
        if is_speed:
            words += f", {_without_rounding(polygon.dq[row, joint], polygon.dq):.4g} {speed}"
        low, high = end.lower[row, joint], end.upper[row, joint]
        lines.append(f"{words}; motors allow {low:.3g} to {high:.3g} {speed if is_speed else effort}")
    if polygon.sliders is not None:
        lines += ["", "## Sliders", ""]
        lines += [
            f"- **{name}**: its front slider at {1e3 * front:.4g} mm, its back slider at {1e3 * back:.4g} mm"
            for name, front, back in zip(arm.joint_names, *polygon.sliders[row], strict=True)
        ]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _without_rounding(value: float, all_values: np.ndarray) -> float:
    """Return a value, or 0 if it is a rounding error relative to the largest of all values."""
    return 0.0 if abs(value) <= DRAWING.rounding * float(np.nanmax(np.abs(all_values))) else float(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaDrawing:
    """Directional maxima on the timeline ``direction``, from 1 on; ``note``: what was left out."""

    scene: MaximaScene
    messages: Sequence[object]
    end: MaximaEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        count, stage, polygon, drawing = len(self.end.polygon), self._stage, self.end.polygon, self._drawing
        stage.log_axes(stream)
        final = self._outline(count, SCREEN.final, 0.8, 0.5) if stage.planar else self._rays(count, SCREEN.final, 0.8)
        stream.log(f"{MAXIMA}/final", final, static=True)  # all maxima, behind everything else
        stream.log(f"{MAXIMA}/origin", stage.points(np.zeros((1, 3)), SCREEN.target, 4.0, 1.0), static=True)
        drawing.log_workcell(stream)
        for chart in self._charts:
            chart.log(stream)
        values = rr.AnyValues(values=polygon.values, directions=polygon.directions.ravel(), q=polygon.q.ravel())
        stream.log("search/maxima", values, static=True)
        for number in range(1, count + 1):
            set_times(stream, direction=number)
            self._log_maxima(stream, number)
            # the arm in the posture of the direction, with the earlier postures behind it
            is_reached = np.isfinite(polygon.values[:number])
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
                    drawing.meshes.log_posture(stream, polygon.q[number - 1])
            log_text(stream, maximum_text(self.scene, self.end, number))
            for chart in self._charts:
                chart.log_cursor(stream, float(number))
        charts, cell = [chart.view() for chart in self._charts], self.scene.workcell
        entries = drawn_entries(
            (f"highest {self.scene.word}s so far", SCREEN.front, True),
            ("this direction", SCREEN.chosen, True),
            ("all directions", SCREEN.final, True),
            ("arm in the posture of this direction", SCREEN.arm, True),
            ("postures of earlier directions", SCREEN.ghost, True),
            ("position of the tool", SCREEN.target, True),
            ("limits of the motors: dashed", SCREEN.text, True),
            ("limits: dashed", SCREEN.text, "position" in cell.bounds),
            ("obstacle", SCREEN.obstacle, cell.obstacles),
        )
        Layout(
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
        ).log(stream)

    def _log_maxima(self, stream: rr.RecordingStream, count: int) -> None:
        """Draw the first ``count`` maxima, the last one as chosen; its name avoids rays and corners."""
        tips, stage, words = self._tips[:count], self._stage, f"direction {count}"
        is_reached = np.isfinite(tips).all(axis=1)
        stream.log(f"{MAXIMA}/rays", self._rays(count, SCREEN.front, 0.6))
        stream.log(f"{MAXIMA}/outline", self._outline(count, SCREEN.front, 1.6, 2.0))
        names = [f"direction {number}" for number in np.flatnonzero(is_reached) + 1]
        corners = stage.points(tips[is_reached], SCREEN.front, 3.2, 3.0, labels=names, show_labels=False)
        stream.log(f"{MAXIMA}/corners", corners)
        chosen = tips[count - 1 : count][is_reached[-1:]]
        arrow = [np.stack([np.zeros(3), tip]) for tip in chosen]
        stream.log(f"{MAXIMA}/chosen/ray", stage.strips(arrow, SCREEN.chosen, 2.0, 4.0))
        stream.log(f"{MAXIMA}/chosen/tip", stage.points(chosen, SCREEN.chosen, 6.0, 5.0))
        said = [words] * len(chosen)
        name = [stage.points(1.12 * chosen, SCREEN.chosen, 0.0, 0.0, labels=said, show_labels=True)]
        if stage.planar:
            shares = np.linspace(0.0, 1.0, 12)[:, None, None]
            rays = stage.place((shares * self._reached(len(self._tips))).reshape(-1, 3))
            marks = stage.place(chosen)
            middles = [label_place(stage.canvas, mark, words, rays) for mark in marks]
            name = [*joined_labels(marks, middles, said, SCREEN.chosen)]
        stream.log(f"{MAXIMA}/chosen/name", *name)

    def _reached(self, count: int) -> np.ndarray:
        """Return the first ``count`` maxima, without those that were not found, as vectors."""
        tips = self._tips[:count]
        return np.asarray(tips[np.isfinite(tips).all(axis=1)])

    def _rays(self, count: int, colour: Colour, radius: float) -> Any:
        return self._stage.strips([np.stack([np.zeros(3), tip]) for tip in self._reached(count)], colour, radius, 0.8)

    def _outline(self, count: int, colour: Colour, radius: float, order: float) -> Any:
        """Return the polygon through the first ``count`` maxima, closed if these are all; nothing in space."""
        tips = self._reached(count)
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
        seen = np.concatenate([np.zeros((1, 3)), self._reached(len(self._tips))])
        if planar and len(seen) == 1:
            seen = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])
        return Stage(entity=MAXIMA, planar=planar, seen=seen, labels=(x, y, z))

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
        end, polygon, cell, arm = self.end, self.end.polygon, self.scene.workcell, self.scene.workcell.arm
        speed, joints, numbers = self.scene.quantity == "velocity", arm.joint_names, np.arange(1.0, len(polygon) + 1)
        labels = {kind: f"joint {kind} [{joint_units(arm, JOINT_UNITS[kind])}]" for kind in JOINT_UNITS}
        ends = np.array([1.0, float(max(len(polygon), 2))])
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
            ("maximum", label, polygon.values[:, None], [self.scene.word], []),
            ("position", labels["position"], polygon.q, joints, limits),
            *([("velocity", labels["velocity"], polygon.dq, joints, capability)] if speed else []),
            ("torque", labels["torque"], polygon.torque, joints, [] if speed else capability),
        ]
        if polygon.sliders is not None:
            places = [f"{side} {name}" for side in ("front", "back") for name in joints]
            shown.append(("sliders", "slider position [m]", polygon.sliders, places, []))
            shown.append(("motor_speeds", "motor speed [m/s]", polygon.motor_speeds, places, []))
            shown.append(("motor_efforts", "motor force [N]", polygon.motor_efforts, places, []))
        charts = []
        for name, label, values, names, lines in shown:
            colours, more = [SCREEN.joint(number) for number in range(len(names))], {"names": names, "limits": lines}
            curves = values.reshape(len(polygon), -1).T
            charts.append(Chart.over("direction", name, label, numbers, curves, colours, dots=True, **more))
        return [charts[0], *fit_below_tabs(charts[1:])]
