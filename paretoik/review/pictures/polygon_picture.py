"""A picture of directional maxima: the polygon, and the arm in some of the postures that reach it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from paretoik.capability.directional import PerformancePolygon
from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import picture
from paretoik.robot.kinematics import link_nodes


def polygon_picture(polygon: PerformancePolygon, file: Path | str) -> None:
    """Write a PNG of a polygon; raises InvalidInput where the file cannot be written."""
    planar = polygon.arm.is_planar
    kind: Any = {"aspect": "equal"} if planar else {"projection": "3d"}
    size = 2 if planar else 3
    solved = np.flatnonzero(np.isfinite(polygon.values))
    unit = "m/s" if polygon.quantity == "velocity" else "N"
    with picture(file, (9.0, 4.0)) as figure:
        maxima, postures = figure.subplots(1, 2, subplot_kw=kind)
        ends = polygon.vertices[solved]
        for end in ends:
            maxima.plot(*np.stack([np.zeros(size), end]).T, color=PAPER.quiet, linewidth=0.7)
        outline = np.concatenate([ends, ends[:1]]) if planar and len(solved) > 2 else ends
        maxima.plot(*outline.T, color=PAPER.accents[0], marker="o", markersize=3.5, linestyle="-" if planar else "none")
        names = ("x", "y", "z")[:size]
        kinds = "speed" if polygon.quantity == "velocity" else "force"
        maxima.set(**{f"{name}label": f"{kinds} along {name} [{unit}]" for name in names})
        links = link_nodes(polygon.arm, polygon.q[solved])[..., :size]
        for line in links:
            postures.plot(*line.T, color=PAPER.ink, alpha=0.25, linewidth=1.3)
        if len(solved):
            best = int(np.argmax(polygon.values[solved]))
            postures.plot(*links[best].T, color=PAPER.accents[1], linewidth=2.0)
            postures.set_title("posture of the greatest maximum", color=PAPER.accents[1])
        postures.plot(*polygon.position[:, None], color=PAPER.accents[0], marker="o")
        postures.set(**{f"{name}label": f"{name} [m]" for name in names})
