"""How a motion is drawn in a recording: the arm along its path, and its joints over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.curve_charts import Chart
from paretoik.review.drawn_axes import Canvas, equal_window
from paretoik.review.palette import SCREEN


@dataclass(frozen=True, kw_only=True)
class MotionScene:
    """A single motion, (time, dof), that is drawn whole as ghosts and replayed on the `motion` timeline.

    An arm that stands still has the postures of other motions, (motions, time, dof), as ghosts beside it.
    """

    motion: Any
    title: str
    others: Any = None

    def views(self) -> tuple[rrb.View, list[rrb.View]]:
        """Return the view of the arm and those of its joints."""
        joints = [*(chart.view() for chart in self._charts()), rrb.TimeSeriesView(origin="joints", name="series")]
        if self.motion.arm.is_planar:
            bounds = self._canvas().bounds()
            return rrb.Spatial2DView(
                origin="arm", name=self.title, visual_bounds=bounds, background=SCREEN.background
            ), joints
        return rrb.Spatial3DView(
            origin="arm", name=self.title, background=SCREEN.background, eye_controls=_eye(self._shown)
        ), joints

    def log(self, recording: rr.RecordingStream, row: rr.TimeColumn) -> None:
        """Log the motion; its rows also stand at `row` of the search's timeline, so that neither is half empty."""
        times = np.asarray(self.motion.time, dtype=float)
        columns = [rr.TimeColumn("motion", duration=times), row]
        self._log_axes_and_path(recording)
        self._send_arm(recording, columns)
        for chart in self._charts():
            chart.log(recording)
            chart.send_cursor(recording, columns)
            style = rr.SeriesLines(names=list(chart.names), colors=[colour[:3] for colour in chart.colours], widths=1.6)
            recording.log(chart.entity.replace("charts", "joints"), style, static=True)
            scalars = rr.Scalars.columns(scalars=chart.curves.T.ravel())
            lengths = [len(chart.names)] * len(times)
            recording.send_columns(chart.entity.replace("charts", "joints"), columns, scalars.partition(lengths))

    def _log_axes_and_path(self, recording: rr.RecordingStream) -> None:
        tool, ghosts = self._on_view(self.motion.tool), self._on_view(self._ghosts)
        if self.motion.arm.is_planar:
            self._canvas().log(recording, "arm/axes", static=True)
        else:
            recording.log("arm", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        strips, _ = self._archetypes
        thin, thick = rr.Radius.ui_points(1.0), rr.Radius.ui_points(1.8)
        recording.log("arm/ghosts", strips(ghosts, colors=SCREEN.ghost, radii=thin, **self._order(0.0)), static=True)
        recording.log("arm/path", strips([tool], colors=SCREEN.path, radii=thick, **self._order(1.0)), static=True)

    @property
    def _ghosts(self) -> np.ndarray:
        """Postures (ghosts, nodes, 3) that are drawn behind the arm."""
        stationary = self.others is not None and not np.ptp(self.motion.q, axis=0).any()
        links = self.others.links[:, 0] if stationary else self.motion.links
        return np.asarray(links[np.unique(np.linspace(0, len(links) - 1, SCREEN.ghosts).round().astype(int))])

    @property
    def _shown(self) -> np.ndarray:
        """The nodes (nodes, 3) of the arm and of its ghosts."""
        return np.concatenate([self.motion.links.reshape(-1, 3), self._ghosts.reshape(-1, 3)])

    def _send_arm(self, recording: rr.RecordingStream, columns: list[rr.TimeColumn]) -> None:
        links = self._on_view(self.motion.links)
        samples, nodes, _ = links.shape
        rod, colours = rr.Radius.ui_points(3.5), [SCREEN.arm] * (nodes - 1) + [SCREEN.tool]
        sizes = rr.Radius.ui_points([5.0] * (nodes - 1) + [6.5])
        strips, points = self._archetypes
        rods = strips.from_fields(colors=SCREEN.arm, radii=rod, **self._order(5.0))
        knots = points.from_fields(colors=colours, radii=sizes, **self._order(6.0))
        positions = points.columns(positions=links.reshape(samples * nodes, -1)).partition([nodes] * samples)
        recording.log("arm/links", rods, static=True)
        recording.log("arm/joints", knots, static=True)
        recording.send_columns("arm/links", columns, strips.columns(strips=list(links)))
        recording.send_columns("arm/joints", columns, positions)

    @property
    def _archetypes(self) -> tuple[Any, Any]:
        """The kinds of strips and points, in the plane or in space."""
        return (rr.LineStrips2D, rr.Points2D) if self.motion.arm.is_planar else (rr.LineStrips3D, rr.Points3D)

    def _order(self, order: float) -> dict[str, float]:
        """Return what is drawn above what, which only the plane knows."""
        return {"draw_order": order} if self.motion.arm.is_planar else {}

    def _charts(self) -> list[Chart]:
        motion, joints = self.motion, self.motion.arm.joint_names
        sliding = np.array([kind == "prismatic" for kind in motion.arm.joint_types])
        colours = [SCREEN.joints[index % len(SCREEN.joints)] for index in range(len(joints))]
        return [
            Chart(
                entity=f"charts/{name}",
                title=f"joint {name}",
                labels=("time [s]", f"{name} [{' or '.join(_units(turning, straight, sliding))}]"),
                instants=np.asarray(motion.time, dtype=float),
                curves=np.asarray(values, dtype=float).T,
                names=joints,
                colours=colours,
            )
            for name, values, turning, straight in (
                ("position", motion.q, "rad", "m"),
                ("velocity", motion.dq, "rad/s", "m/s"),
                ("torque", motion.torque, "N m", "N"),
            )
        ]

    def _canvas(self) -> Canvas:
        nodes = np.concatenate([self._shown[:, :2], self.motion.tool.reshape(-1, 2)])
        low, high = equal_window(nodes, width=140.0, height=100.0)
        return Canvas(low=low, high=high, labels=("x [m]", "y [m]"))

    def _on_view(self, points: np.ndarray) -> np.ndarray:
        return self._canvas().place(points[..., :2]) if self.motion.arm.is_planar else points


def _units(turning: str, straight: str, sliding: np.ndarray) -> list[str]:
    return [turning] * bool((~sliding).any()) + [straight] * bool(sliding.any())


def _eye(nodes: np.ndarray) -> rrb.EyeControls3D:
    """Look at the middle of the whole motion from in front, from the right and from above."""
    middle, size = (nodes.min(axis=0) + nodes.max(axis=0)) / 2, float(np.ptp(nodes, axis=0).max())
    return rrb.EyeControls3D(position=middle + size * np.array([1.1, -1.3, 0.8]), look_target=middle)
