"""Where a tool is to be, marked around the tool of an arm, and whether an arm on top leaves others to be seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.review.drawing.arm_drawing import ArmDrawing
from paretoik.review.drawing_options import MARKS, SCENES, VIEWS
from paretoik.review.palette import SCREEN


def target_mark(drawing: ArmDrawing, place: Float[np.ndarray, " 3"]) -> Any:
    """Return the mark of a place [m] that a tool on it does not cover: in the plane a ring, in space a cross."""
    if drawing.planar:
        turn = np.linspace(0.0, 2 * np.pi, 49)
        ring = drawing.place(place) + MARKS.target_ring * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return rr.LineStrips2D([ring], colors=SCREEN.path, radii=rr.Radius.ui_points(1.2), draw_order=9.0)
    reach = SCENES.cross * np.ptp(drawing.nodes, axis=0).max() * np.eye(3)
    return drawing.strips([np.stack([place - each, place + each]) for each in reach], SCREEN.path, 1.2, 9.0)


def is_seen_beside(drawing: ArmDrawing, distance: float) -> bool:
    """Say whether a thin arm at a ``distance`` [m] from a solid one is seen beside it, in space at an average depth."""
    if drawing.planar:
        origin, unit = drawing.place(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
        return bool(distance * np.linalg.norm(unit - origin) > MARKS.solid_arm)
    scale = VIEWS.panels[0] / np.ptp(drawing.nodes, axis=0).max()
    return bool(distance * scale > MARKS.spatial_arms[0])
