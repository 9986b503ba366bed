"""The layers of points that a panel of two objectives shows, each with its colour and size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import rerun as rr

from paretoik.review.palette import SCREEN, Colour

Layer = Literal["population", "final", "front", "chosen", "looked_at", "choice", "compared"]
LAYERS: dict[Layer, tuple[Colour, float, float]] = {  # colour, radius, which is drawn above which
    "population": (SCREEN.population, 2.2, 1.0),
    "final": (SCREEN.final, 2.6, 0.5),
    "front": (SCREEN.front, 3.2, 2.0),
    "chosen": (SCREEN.chosen, 6.5, 4.0),
    "looked_at": (SCREEN.arm, 4.0, 4.5),  # as its arm; smaller, so that an end or a choice below it stays seen
    "choice": (SCREEN.chosen, 6.5, 4.0),
    "compared": (SCREEN.compared, 6.5, 3.5),
}


def layer_points(layer: Layer, places: np.ndarray, hovered: Sequence[str] | None) -> rr.Points2D:
    """Return the points of a layer at places (points, 2) [pixels], with what is said of them under the mouse."""
    colour, radius, order = LAYERS[layer]
    radii = rr.Radius.ui_points(radius)
    return rr.Points2D(places, colors=colour, radii=radii, labels=hovered, show_labels=False, draw_order=order)
