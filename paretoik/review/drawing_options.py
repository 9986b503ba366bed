"""How much is drawn of what: sizes and bounds of drawings in recordings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class DrawingOptions:
    """Bounds of what a recording draws.

    Up to ``matrix`` objectives every pair has a panel, beyond only neighbours; parallel coordinates come from
    ``parallel`` objectives on, and more than ``parallel_lines`` points are a grey area there. The timeline along the
    front has at most so many points, ``walk``, that along the starts of a plan so many, ``starts``. Of a plan's
    optima so many, ``optima``, are listed, and what so large a share of starts as ``near`` led to is on its axes.
    Timelines of generations play ``frames`` of them a second, those of a few things that are looked at one by one
    ``slow_frames``.

    A limit is in the chart where it lies at most ``limit_distance`` ranges of the curves off, and counts as kept where
    it is passed by at most such a share of its range, ``kept``. A value that is at most such a share of the largest,
    ``rounding``, is written as 0. Outlines of obstacles
    have so many ``corners``; where a body meets the plane is found on a grid of ``section`` points a side. Meshes are
    drawn up to so many ``mesh_bytes``, since a recording holds them whole.
    """

    matrix: int = 5
    parallel: int = 3
    parallel_lines: int = 200
    walk: int = 60
    starts: int = 240
    optima: int = 12
    near: float = 0.9
    frames: float = 6.0
    slow_frames: float = 1.0
    limit_distance: float = 2.5
    kept: float = 1e-6
    rounding: float = 1e-10
    corners: int = 96
    section: int = 160
    mesh_bytes: float = 40e6


DRAWING = DrawingOptions()
