"""How motions are drawn in a recording: arms along their path, and what their joints do over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.review.drawing.arm_drawing import ArmDrawing
from paretoik.review.drawing.curve_charts import Chart
from paretoik.review.drawing.joint_charts import joint_charts
from paretoik.review.drawing.screen_text import entity_names, screen_text
from paretoik.review.drawing_options import DRAWING
from paretoik.review.even_rows import even_rows
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorded_point import RecordedMotion, RecordedPoint, joint_curves
from paretoik.review.recording.workcell import Workcell
from paretoik.robot.kinematics import link_nodes

CHOSEN = "chosen"
NO_TIMES = np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionScene:
    """Motions of a workcell's arm, of the best points of the objectives called ``names`` and of a chosen one.

    Axes hold all motions of ``points``, at least one of the chosen. Everything is drawn at entities that begin with
    ``root``; those of other points than the chosen have a ``prefix`` and a name.
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

    @cached_property
    def charts(self) -> dict[str, Chart]:
        """The charts of joints by kind of quantity."""
        motions = [point.motion for point in self.points if point.motion is not None and point.axis is None]
        curves = [(motion.time, self._curves(motion)) for motion in motions]
        return joint_charts(f"{self.root}joint_charts", self.workcell, curves)

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw what does not move: the workcell and the axes of charts."""
        self.drawing.log_workcell(recording)
        for chart in self.charts.values():
            chart.log(recording)

    def log_whole(
        self, recording: rr.RecordingStream, points: Sequence[RecordedPoint], *, row: int | None = None
    ) -> None:
        """Draw motions of points as wholes at the current time: paths, and of the chosen one ghosts and curves.

        Their arms stand at a ``row`` of their samples, by default at half the time.
        """
        for point in points:
            if point.motion is None:
                continue
            links, drawing, layer = (
                self._links(point.motion.q),
                self.drawing,
                f"{self.drawing.entity}/{self.layer(point)}",
            )
            chosen = point.axis is None
            if not point.motion.is_standing and (chosen or not self.workcell.paths):  # what follows one has the same
                colour, width = (SCREEN.path, 1.4) if chosen else (SCREEN.end(point.axis or 0), 1.0)
                recording.log(f"{layer}/path", drawing.strips([links[:, -1]], colour, width, 1.0))
            if chosen:
                ghosts = drawing.strips(list(links[even_rows(len(links), SCREEN.ghosts)]), SCREEN.ghost, 1.0, 0.0)
                recording.log(f"{layer}/ghosts", ghosts)
                curves = self._curves(point.motion)
                for kind, chart in self.charts.items():
                    chart.draw(recording, point.motion.time, curves[kind].T)
            self._log_posture(recording, point, len(links) // 2 if row is None else row)

    def log_postures(self, recording: rr.RecordingStream, postures: Float[np.ndarray, "postures dof"]) -> None:
        """Draw postures as ghosts, for all times."""
        rows = even_rows(len(postures), SCREEN.ghosts)
        ghosts = self.drawing.strips(list(self._links(postures[rows])), SCREEN.ghost, 1.0, 0.0)
        recording.log(f"{self.drawing.entity}/postures", ghosts, static=True)

    def send(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        columns: Sequence[rr.TimeColumn],
        rows: np.ndarray | None = None,
    ) -> None:
        """Let the arm of a point move: a row of ``columns`` a sample of its motion, or of its ``rows``."""
        motion = point.motion
        if motion is None:
            return
        rows = np.arange(len(motion.time)) if rows is None else rows
        self.send_postures(recording, self.layer(point), columns, motion.q[rows], point.axis)
        if point.axis is None:
            for chart in self.charts.values():
                chart.send_cursor(recording, columns, motion.time[rows])

    def send_motion(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        times: Float[np.ndarray, " instants"] = NO_TIMES,
        *,
        charts: Sequence[Chart] = (),
    ) -> None:
        """Let the arm of a point move on the timeline ``motion``, between its samples too, and at ``times`` [s].

        Between samples joints move evenly. What joints of the chosen point do is logged at the samples; cursors of
        further ``charts`` move with it.
        """
        motion = point.motion
        if motion is None or motion.is_standing:
            return
        samples = motion.time - motion.time[0]
        times = np.union1d(motion_frames(samples), times)
        columns = [rr.TimeColumn("motion", duration=times)]
        q = np.stack([np.interp(times, samples, each) for each in motion.q.T], axis=1)
        self.send_postures(recording, self.layer(point), columns, q, point.axis)
        if point.axis is None:
            for chart in (*self.charts.values(), *charts):
                chart.send_cursor(recording, columns, motion.time[0] + np.minimum(times, samples[-1]))
            self.send_series(recording, point, [rr.TimeColumn("motion", duration=samples)])

    def send_series(
        self, recording: rr.RecordingStream, point: RecordedPoint, columns: Sequence[rr.TimeColumn]
    ) -> None:
        """Keep what the joints of a point do exactly, a row of ``columns`` a sample."""
        if point.motion is None:
            return
        for kind, values in self._curves(point.motion).items():
            style = rr.SeriesLines(names=[screen_text(name) for name in self.workcell.arm.joint_names])
            recording.log(f"{self.root}joints/{kind}", style, static=True)
            scalars = rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(values))
            recording.send_columns(f"{self.root}joints/{kind}", columns, scalars)

    def send_postures(
        self,
        recording: rr.RecordingStream,
        layer: str,
        columns: Sequence[rr.TimeColumn],
        q: Float[np.ndarray, "rows dof"],
        axis: int | None,
    ) -> None:
        """Let the arm of a layer stand in postures, a row of ``columns`` each; the chosen one, without axis, solid."""
        self.drawing.send_arms(recording, layer, columns, self._links(q), axis)
        if axis is None and self.drawing.meshes is not None:
            self.drawing.meshes.send(recording, columns, q)

    def layer(self, point: RecordedPoint) -> str:
        """Return the part of entity paths that a point's arm has."""
        return CHOSEN if point.axis is None else self.prefix + entity_names(self.names)[point.axis]

    @cached_property
    def drawing(self) -> ArmDrawing:
        """Where arms are drawn."""
        motions = [point.motion for point in self.points if point.motion is not None]
        picked = [motion.q[even_rows(len(motion.q), SCREEN.ghosts)] for motion in motions]
        nodes = self._links(np.concatenate(picked)).reshape(-1, 3)
        return ArmDrawing(entity=f"{self.root}arm", workcell=self.workcell, nodes=nodes)

    def _log_posture(self, recording: rr.RecordingStream, point: RecordedPoint, row: int) -> None:
        """Let the arm of a point stand at a sample of its motion, at the current time."""
        motion = point.motion
        assert motion is not None
        self.drawing.log_arm(recording, self.layer(point), self._links(motion.q[row : row + 1])[0], point.axis)
        if point.axis is None:
            for chart in self.charts.values():
                chart.log_cursor(recording, float(motion.time[row]))
            if self.drawing.meshes is not None:
                self.drawing.meshes.log_posture(recording, motion.q[row])

    def _curves(self, motion: RecordedMotion) -> Mapping[str, np.ndarray]:
        """Return the joint quantities of a motion."""
        if id(motion) not in self._known_curves:
            self._known_curves[id(motion)] = joint_curves(self.workcell, motion)
        return self._known_curves[id(motion)]

    @cached_property
    def _known_curves(self) -> dict[int, Mapping[str, np.ndarray]]:
        """Joint quantities by the identity of motions, which ``points`` keep alive."""
        return {}

    def _links(self, q: Float[np.ndarray, "rows dof"]) -> Float[np.ndarray, "rows nodes 3"]:
        return np.asarray(link_nodes(self.workcell.arm, q))


def motion_frames(samples: Times) -> Float[np.ndarray, " frames"]:
    """Return the times of samples [s], and so many between them that an arm is nowhere seen to lag behind.

    >>> motion_frames(np.array([0.0, 1.0]))[[0, 25, -1]].tolist()
    [0.0, 0.25, 1.0]
    """
    longest = np.ptp(samples) / DRAWING.motion_frames
    parts = np.ceil(np.diff(samples) / longest - 1e-6).astype(int)
    within = [number + np.arange(1, count + 1) / count for number, count in enumerate(parts)]
    return np.asarray(np.interp(np.concatenate([[0.0], *within]), np.arange(len(samples)), samples))
