"""The eye on a scene in space: as near as it may be while all that is to be seen lies in its view."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.review.drawing_options import SCENES, VIEWS


def fitting_eye(points: Float[np.ndarray, "points 3"]) -> rrb.EyeControls3D:
    """Return the eye that sees all of some points, as large as its view allows.

    A point at p across and z deep is in sight from the distance d where |p - c| <= h (d + z), with h half the view and
    c its middle: the least distance follows from the points that bind on either side.
    """
    axes, half = _camera_axes(), half_view()
    middle = points.mean(axis=0)
    places = (points - middle) @ axes.T
    across, deep = places[:, :2], half * places[:, 2:]
    most, least = (across - deep).max(axis=0), (across + deep).min(axis=0)
    distance = float(((most - least) / (2 * half)).max())
    target = middle + (most + least) / 2 @ axes[:2]
    return rrb.EyeControls3D(position=target - distance * axes[2], look_target=target)


def half_view() -> Float[np.ndarray, " 2"]:
    """Return half the width and height of what is seen at distance 1, less what labels need at the margins."""
    width, height = VIEWS.panels[0], VIEWS.panels[1] - VIEWS.title
    whole = np.tan(np.radians(SCENES.field_of_view) / 2) * np.array([width / height, 1.0])
    return np.asarray(whole * (1.0 - 2.0 * np.array(SCENES.label_margin) / (width, height)))


def _camera_axes() -> Float[np.ndarray, "3 3"]:
    """Return the unit vectors to the right, upwards and away from the eye."""
    away = -np.array(SCENES.eye) / np.linalg.norm(SCENES.eye)
    right = np.cross(away, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, away), away])
