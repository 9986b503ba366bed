"""Obstacles in pictures: filled outlines in the plane, wires in space."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

from paretoik.review.obstacle_outlines import outline, wires
from paretoik.review.palette import PAPER


def draw_obstacles(axes: Axes, motion: Any) -> None:
    """Draw the obstacles of a single `motion`; what has no ends in space is as high as the arm comes."""
    if motion.arm.is_planar:
        for line in map(outline, motion.obstacles):
            if line is not None:
                axes.fill(*line.T, facecolor=PAPER.quiet, alpha=0.5, linewidth=0.0)
        return
    height = (min(0.0, float(motion.links[..., 2].min())), float(motion.links[..., 2].max()))
    for obstacle in motion.obstacles:
        for wire in wires(obstacle, height):
            axes.plot(*wire.T, color=PAPER.quiet, linewidth=0.6, alpha=0.8)
