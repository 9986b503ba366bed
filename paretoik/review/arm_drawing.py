"""Where arms are drawn in a recording: on axes of their own where they are planar, else in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.review.drawn_axes import Canvas, equal_window
from paretoik.review.palette import SCREEN


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmDrawing:
    """The view at ``entity`` of arms, ``planar`` or not; it holds all ``nodes`` (nodes, 3) [m]."""

    entity: str
    planar: bool
    nodes: Float[np.ndarray, "nodes 3"]

    def view(self, name: str) -> rrb.View:
        """Return the view."""
        if self.planar:
            bounds = self._canvas.bounds()
            return rrb.Spatial2DView(origin=self.entity, name=name, visual_bounds=bounds, background=SCREEN.background)
        return rrb.Spatial3DView(origin=self.entity, name=name, background=SCREEN.background, eye_controls=self._eye())

    def log_axes(self, recording: rr.RecordingStream) -> None:
        """Draw the axes, for all times."""
        if self.planar:
            self._canvas.log(recording, f"{self.entity}/axes", static=True)
        else:
            recording.log(self.entity, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return where points (..., 3) [m] lie on the view."""
        return self._canvas.place(points[..., :2]) if self.planar else points

    @property
    def archetypes(self) -> tuple[Any, Any]:
        """The kinds of strips and points, in the plane or in space."""
        return (rr.LineStrips2D, rr.Points2D) if self.planar else (rr.LineStrips3D, rr.Points3D)

    def order(self, order: float) -> dict[str, float]:
        """Return what is drawn above what, which only the plane knows."""
        return {"draw_order": order} if self.planar else {}

    @cached_property
    def _canvas(self) -> Canvas:
        low, high = equal_window(self.nodes[:, :2], width=140.0, height=100.0)
        return Canvas(low=low, high=high, labels=("x [m]", "y [m]"))

    def _eye(self) -> rrb.EyeControls3D:
        """Look at the middle of everything from in front, from the right and from above."""
        low, high = self.nodes.min(axis=0), self.nodes.max(axis=0)
        middle, size = (low + high) / 2, float((high - low).max())
        return rrb.EyeControls3D(position=middle + size * np.array([1.1, -1.3, 0.8]), look_target=middle)
