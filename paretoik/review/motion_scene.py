"""How a motion is drawn in a recording: the arm along its path, and its joints over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.arm_drawing import ArmDrawing
from paretoik.review.curve_charts import Chart
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
        return self._drawing.view(self.title), joints

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
        drawing = self._drawing
        tool, ghosts = drawing.place(self.motion.tool), drawing.place(self._ghosts)
        drawing.log_axes(recording)
        strips, _ = drawing.archetypes
        thin, thick = rr.Radius.ui_points(1.0), rr.Radius.ui_points(1.8)
        recording.log("arm/ghosts", strips(ghosts, colors=SCREEN.ghost, radii=thin, **drawing.order(0.0)), static=True)
        recording.log("arm/path", strips([tool], colors=SCREEN.path, radii=thick, **drawing.order(1.0)), static=True)

    @property
    def _ghosts(self) -> np.ndarray:
        """Postures (ghosts, nodes, 3) that are drawn behind the arm."""
        stationary = self.others is not None and not np.ptp(self.motion.q, axis=0).any()
        links = self.others.links[:, 0] if stationary else self.motion.links
        return np.asarray(links[np.unique(np.linspace(0, len(links) - 1, SCREEN.ghosts).round().astype(int))])

    def _send_arm(self, recording: rr.RecordingStream, columns: list[rr.TimeColumn]) -> None:
        drawing = self._drawing
        links = drawing.place(self.motion.links)
        samples, nodes, _ = links.shape
        rod, colours = rr.Radius.ui_points(3.5), [SCREEN.arm] * (nodes - 1) + [SCREEN.tool]
        sizes = rr.Radius.ui_points([5.0] * (nodes - 1) + [6.5])
        strips, points = drawing.archetypes
        rods = strips.from_fields(colors=SCREEN.arm, radii=rod, **drawing.order(5.0))
        knots = points.from_fields(colors=colours, radii=sizes, **drawing.order(6.0))
        positions = points.columns(positions=links.reshape(samples * nodes, -1)).partition([nodes] * samples)
        recording.log("arm/links", rods, static=True)
        recording.log("arm/joints", knots, static=True)
        recording.send_columns("arm/links", columns, strips.columns(strips=list(links)))
        recording.send_columns("arm/joints", columns, positions)

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

    @cached_property
    def _drawing(self) -> ArmDrawing:
        nodes = np.concatenate([self.motion.links.reshape(-1, 3), self._ghosts.reshape(-1, 3)])
        return ArmDrawing(entity="arm", planar=self.motion.arm.is_planar, nodes=nodes)


def _units(turning: str, straight: str, sliding: np.ndarray) -> list[str]:
    return [turning] * bool((~sliding).any()) + [straight] * bool(sliding.any())
