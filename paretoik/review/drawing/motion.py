"""Motions in a recording: arms along their path, and joint quantities over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Times, Values
from paretoik.review.drawing.arm import ArmDrawing
from paretoik.review.drawing.axes import entity_names, screen_text
from paretoik.review.drawing.charts import Chart, LimitLine, curve_points, fit_below_tabs
from paretoik.review.drawing.layout import Entry, drawn_entries
from paretoik.review.palette import DRAWING, SCREEN, even_rows
from paretoik.review.recording.messages import RecordedMotion, RecordedPoint, Workcell, joint_curves
from paretoik.robot.kinematics import joint_scales, link_nodes
from paretoik.task.limits import JOINT_UNITS, is_sliding, joint_units, usual_ranges

CurvedMotion = tuple[np.ndarray, Mapping[str, np.ndarray]]  # times (time,), and (time, dof) by kind
ALWAYS = ("position", "velocity", "torque")
OF_MASSES = ("torque", "power")


def joint_charts(root: str, cell: Workcell, motions: Sequence[CurvedMotion]) -> dict[str, Chart]:
    """Return one chart per kind of quantity, at entities below ``root``; each fits all ``motions``.

    Accelerations and powers are only drawn if they are limited; torques and powers only if the arm has masses.
    """
    charts, sliding = {}, is_sliding(cell.arm)
    has_masses = any(body.mass > 0.0 or bool(np.any(body.inertia)) for body in cell.arm.bodies)
    for kind, units in JOINT_UNITS.items():
        if not motions or (kind not in ALWAYS and kind not in cell.bounds) or (kind in OF_MASSES and not has_masses):
            continue
        end = max(float(time[-1]) for time, _ in motions)
        duration = max(float(np.ptp(time)) for time, _ in motions) or 1.0
        title = {"torque": "joint torque" if not sliding.all() else "joint force"}.get(kind, f"joint {kind}")
        charts[kind] = Chart(
            entity=f"{root}/{kind}",
            title=title,
            labels=("time [s]", f"{title} [{joint_units(cell.arm, units)}]"),
            shown=np.concatenate([curve_points(time, curves[kind].T) for time, curves in motions]),
            names=cell.arm.joint_names,
            colours=[SCREEN.joint(number) for number in range(cell.arm.dof)],
            limits=limit_lines(cell, kind, end),
            usual=float(usual_ranges(kind, cell.arm, duration).max()),
        )
    return dict(zip(charts, fit_below_tabs(list(charts.values())), strict=True))


def posture_chart(cell: Workcell, values: Values, postures: Float[np.ndarray, "points dof"], label: str) -> Chart:
    """Return the chart of joint positions (points, dof) over values of an objective."""
    return Chart(
        entity="postures",
        dots=True,
        title="joint positions on the final front",
        labels=(label, f"joint position [{joint_units(cell.arm, JOINT_UNITS['position'])}]"),
        names=cell.arm.joint_names,
        colours=[SCREEN.joint(number) for number in range(cell.arm.dof)],
        instants=values,
        curves=postures.T,
        limits=[
            replace(limit, instants=np.array([values.min(), values.max()]))
            for limit in limit_lines(cell, "position", 1.0)
        ],
        usual=float(joint_scales(cell.arm).max()),
    )


def limit_lines(cell: Workcell, kind: str, end: float) -> list[LimitLine]:
    """Return the limits of a kind up to ``end`` [s]; a limit that joints share is one line in their colours."""
    bounds, lines, names = cell.bounds.get(kind, np.zeros((1, 0, 2))), list[LimitLine](), cell.arm.joint_names
    instants = np.array([0.0, end]) if len(bounds) == 1 else cell.times
    bounds = np.repeat(bounds, 2, axis=0) if len(bounds) == 1 else bounds
    for limits in np.moveaxis(bounds, -1, 0):  # lower limits (time, dof), then upper limits
        joints: dict[bytes, list[int]] = {}
        for number, values in enumerate(limits.T):
            if np.isfinite(values).any():
                joints.setdefault((values + 0.0).tobytes(), []).append(number)
        for numbers in joints.values():
            is_common = len(numbers) == cell.arm.dof
            name = "" if is_common else ", ".join(names[number] for number in numbers)
            colours = [SCREEN.limit] if is_common else [SCREEN.joint(number) for number in numbers]
            lines.append(LimitLine(instants=instants, values=limits[:, numbers[0]], name=name, colours=colours))
    return lines


# The timeline ``replay`` shows one generation after another; the arm moves in generations with motions.


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """Durations and sizes of the timeline ``replay``."""

    moving: float = 1.0  # duration of a generation whose arm moves [s]
    standing: float = 0.1  # duration of any other generation [s]
    generations: int = 60  # largest number of generations whose arm moves
    samples: int = 41  # largest number of samples of each motion


OPTIONS = ReplayOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayClock:
    """The beginnings of generations [s], those whose arm moves, and the end of the last one [s]."""

    begins: Times
    moving: frozenset[int]
    end: float

    @staticmethod
    def of(generations: Sequence[Sequence[RecordedPoint]]) -> ReplayClock:
        """Return the clock of generations, given each one's points; an arm moves in evenly spread ones."""
        able = [i for i, points in enumerate(generations) if is_moving(points)]
        moving = frozenset(able[i] for i in even_rows(len(able), OPTIONS.generations))
        lengths = [OPTIONS.moving if i in moving else OPTIONS.standing for i in range(len(generations))]
        ends = np.cumsum([0.0, *lengths])
        return ReplayClock(begins=ends[:-1], moving=moving, end=float(ends[-1]))


def is_moving(points: Sequence[RecordedPoint]) -> bool:
    """Return whether points have motions in which an arm moves."""
    return any(point.motion is not None and not point.motion.is_standing for point in points)


def has_motions(points: Sequence[RecordedPoint]) -> bool:
    """Return whether points have motions."""
    return any(point.motion is not None for point in points)


CHOSEN = "chosen"
NO_TIMES = np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionScene:
    """Motions of a workcell's arm: the best points of the objectives ``names``, and a chosen point.

    Axes contain all motions of ``points``, which include at least one chosen point. All entities begin with ``root``;
    those of points that are not chosen have a ``prefix`` and a name.
    """

    workcell: Workcell
    names: tuple[str, ...]
    points: Sequence[RecordedPoint]
    title: str = "arm"
    root: str = ""
    prefix: str = "best "

    def view(self) -> rrb.View:
        """Return the view of the arm."""
        return self.drawing.view(self.title)

    def entries(self, arm: str = "arm", *, postures: str = "") -> list[Entry]:
        """Return the names and colours in the drawing; ``arm``: name of the solid arm.

        ``postures``: name of the postures drawn behind arms that stand still, "" for none.
        """
        cell, moving = self.workcell, is_moving(self.points)
        places = "important places" if len(cell.places) > 1 else next(iter(cell.places), "")
        return drawn_entries(
            (arm, SCREEN.arm, True),
            ("its links", SCREEN.body if cell.arm.is_planar else (*SCREEN.hull[:3], 255), np.any(cell.link_radius)),
            ("its postures over time", SCREEN.ghost, moving),
            ("path of its tool", SCREEN.path, moving),
            (postures, SCREEN.ghost, postures and not moving),
            ("path to follow", SCREEN.target, cell.paths),
            (places, SCREEN.target, cell.places),
            ("directions", SCREEN.target, len(cell.directions)),
            ("obstacle", SCREEN.obstacle, cell.obstacles),
            ("limits: dashed", SCREEN.text, any(chart.limits for chart in self.charts.values())),
        )

    @cached_property
    def charts(self) -> dict[str, Chart]:
        """The charts of joints by kind of quantity."""
        motions = [point.motion for point in self.points if point.motion is not None and point.axis is None]
        curves = [(motion.time, joint_curves(self.workcell, motion)) for motion in motions]
        return joint_charts(f"{self.root}joint_charts", self.workcell, curves)

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw what does not move: the workcell and the axes of charts."""
        self.drawing.log_workcell(recording)
        for chart in self.charts.values():
            chart.log(recording)

    def log_whole(
        self, recording: rr.RecordingStream, points: Sequence[RecordedPoint], *, row: int | None = None
    ) -> None:
        """Draw motions of points at the current time: paths; postures and curves of the chosen one."""
        drawing = self.drawing
        for point in points:
            motion, is_chosen = point.motion, point.axis is None
            if motion is None:
                continue
            links, layer = self._links(motion.q), f"{drawing.entity}/{self.layer(point)}"
            place = len(links) // 2 if row is None else row
            if not motion.is_standing and (is_chosen or not self.workcell.paths):  # all arms share a prescribed path
                colour, width = (SCREEN.path, 1.4) if is_chosen else (SCREEN.end(point.axis or 0), 1.0)
                recording.log(f"{layer}/path", drawing.stage.strips([links[:, -1]], colour, width, 1.0))
            drawing.log_arm(recording, self.layer(point), links[place], point.axis)
            if not is_chosen:
                continue
            ghosts = drawing.stage.strips(list(links[even_rows(len(links), SCREEN.ghosts)]), SCREEN.ghost, 1.0, 0.0)
            recording.log(f"{layer}/ghosts", ghosts)
            curves = joint_curves(self.workcell, motion)
            for kind, chart in self.charts.items():
                chart.draw(recording, motion.time, curves[kind].T)
                chart.log_cursor(recording, float(motion.time[place]))
            if drawing.meshes is not None:
                drawing.meshes.log_posture(recording, motion.q[place])

    def log_predicted(self, recording: rr.RecordingStream, motion: RecordedMotion | None) -> None:
        """Draw postures of a predicted motion, for all times, and its tool path if no path is prescribed."""
        links = np.zeros((0, 2, 3)) if motion is None else self._links(motion.q)
        ghosts = list(links[even_rows(len(links), SCREEN.ghosts)]) if len(links) else []
        path = [links[:, -1]] if len(links) > 1 and not self.workcell.paths else []
        entity, drawing = f"{self.drawing.entity}/predicted", self.drawing
        recording.log(f"{entity}/ghosts", drawing.stage.strips(ghosts, SCREEN.predicted, 1.4, 1.5), static=True)
        recording.log(f"{entity}/path", drawing.stage.strips(path, SCREEN.predicted, 1.8, 1.6), static=True)

    def log_postures(self, recording: rr.RecordingStream, postures: Float[np.ndarray, "postures dof"]) -> None:
        """Draw postures as ghosts, for all times."""
        rows = even_rows(len(postures), SCREEN.ghosts)
        ghosts = self.drawing.stage.strips(list(self._links(postures[rows])), SCREEN.ghost, 1.0, 0.0)
        recording.log(f"{self.drawing.entity}/postures", ghosts, static=True)

    def send_replay(
        self, recording: rr.RecordingStream, slots: Sequence[tuple[float, Sequence[RecordedPoint]]]
    ) -> None:
        """Move arms on the timeline ``replay``; each slot has its beginning [s] and its points."""
        for begin, points in slots:
            motions = [(point, point.motion) for point in points if point.motion is not None]
            longest = max((float(np.ptp(motion.time)) for _, motion in motions), default=0.0)
            for point, motion in motions:
                rows = even_rows(len(motion.time), OPTIONS.samples)
                share = (motion.time[rows] - motion.time[0]) / max(longest, 1e-12)
                column = rr.TimeColumn("replay", duration=begin + 0.9 * OPTIONS.moving * share)
                self.send(recording, point, [column], motion.q[rows], motion.time[rows])

    def send_motion(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        times: Float[np.ndarray, " instants"] = NO_TIMES,
        *,
        charts: Sequence[Chart] = (),
    ) -> None:
        """Move the arm of a point on the timeline ``motion``, also between its samples and at ``times`` [s].

        Joints are interpolated linearly between samples. If the point is chosen, its joint quantities are logged at the
        samples. Cursors of further ``charts`` move along.
        """
        motion = point.motion
        if motion is None or motion.is_standing:
            return
        samples = motion.time - motion.time[0]
        times = np.union1d(motion_frames(samples), times)
        columns = [rr.TimeColumn("motion", duration=times)]
        q = np.stack([np.interp(times, samples, each) for each in motion.q.T], axis=1)
        self.send(recording, point, columns, q, motion.time[0] + np.minimum(times, samples[-1]), charts)
        if point.axis is None:
            self.send_series(recording, point, [rr.TimeColumn("motion", duration=samples)])

    def send(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        columns: Sequence[rr.TimeColumn],
        q: Float[np.ndarray, "rows dof"],
        instants: Times,
        charts: Sequence[Chart] = (),
    ) -> None:
        """Show a point's arm in postures ``q``, one per row of ``columns``; cursors at ``instants``."""
        self.drawing.send_arms(recording, self.layer(point), columns, self._links(q), point.axis)
        if point.axis is not None:
            return
        if self.drawing.meshes is not None:
            self.drawing.meshes.send(recording, columns, q)
        for chart in (*self.charts.values(), *charts):
            chart.send_cursor(recording, columns, instants)

    def send_series(
        self, recording: rr.RecordingStream, point: RecordedPoint, columns: Sequence[rr.TimeColumn]
    ) -> None:
        """Record the exact joint quantities of a point, one row of ``columns`` per sample."""
        if point.motion is None:
            return
        for kind, values in joint_curves(self.workcell, point.motion).items():
            style = rr.SeriesLines(names=[screen_text(name) for name in self.workcell.arm.joint_names])
            recording.log(f"{self.root}joints/{kind}", style, static=True)
            scalars = rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
            recording.send_columns(f"{self.root}joints/{kind}", columns, scalars)

    def layer(self, point: RecordedPoint) -> str:
        """Return the part of entity paths that belongs to a point's arm."""
        return CHOSEN if point.axis is None else self.prefix + entity_names(self.names)[point.axis]

    @cached_property
    def drawing(self) -> ArmDrawing:
        """The drawing of arms."""
        motions = [point.motion for point in self.points if point.motion is not None]
        picked = [motion.q[even_rows(len(motion.q), SCREEN.ghosts)] for motion in motions]
        nodes = self._links(np.concatenate(picked)).reshape(-1, 3)
        return ArmDrawing(entity=f"{self.root}arm", workcell=self.workcell, nodes=nodes)

    def _links(self, q: Float[np.ndarray, "rows dof"]) -> Float[np.ndarray, "rows nodes 3"]:
        return np.asarray(link_nodes(self.workcell.arm, q))


def motion_views(motions: MotionScene | None) -> dict[str, Any]:
    """Return the views of motions, if any, as arguments of a layout."""
    if motions is None:
        return {}
    return {"arm": motions.view(), "joints": [chart.view() for chart in motions.charts.values()]}


def motion_frames(samples: Times) -> Float[np.ndarray, " frames"]:
    """Return the times of samples [s], and enough times between them for a smooth motion.

    >>> motion_frames(np.array([0.0, 1.0]))[[0, 25, -1]].tolist()
    [0.0, 0.25, 1.0]
    """
    longest = np.ptp(samples) / DRAWING.motion_frames
    parts = np.ceil(np.diff(samples) / longest - 1e-6).astype(int)
    within = [number + np.arange(1, count + 1) / count for number, count in enumerate(parts)]
    return np.asarray(np.interp(np.concatenate([[0.0], *within]), np.arange(len(samples)), samples))
