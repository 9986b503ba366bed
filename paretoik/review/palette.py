"""Colours, sizes and labels of what is drawn: one record for pictures on paper, one for recordings on a screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Bool, Int

from paretoik.robot.arm import Arm

# The units that quantities of an arm's joints have, which turn or slide.


def joint_units(arm: Arm, units: tuple[str, str]) -> str:
    """Return the units of an arm's joints of two, of turning and of sliding ones."""
    (turning, straight), sliding = units, is_sliding(arm)
    return " or ".join(dict.fromkeys([turning] * bool((~sliding).any()) + [straight] * bool(sliding.any())))


def has_masses(arm: Arm) -> bool:
    """Say whether an arm has masses or inertias, without which its torques and powers are 0 whatever it does."""
    return any(body.mass > 0.0 or bool(np.any(body.inertia)) for body in arm.bodies)


def is_sliding(arm: Arm) -> Bool[np.ndarray, " dof"]:
    """Say which joints slide."""
    return np.array([kind == "prismatic" for kind in arm.joint_types])


# Rows that are evenly spread over many, the first and the last among them.


def even_rows(count: int, largest: int) -> Int[np.ndarray, " rows"]:
    """Return rows of ``count``, evenly spread and at most ``largest`` of them; all where there are not more.

    >>> even_rows(9, 3).tolist(), even_rows(2, 3).tolist(), even_rows(0, 3).tolist()
    ([0, 4, 8], [0, 1], [])
    """
    return np.unique(np.linspace(0, count - 1, min(count, largest)).round().astype(np.int64))


# How much is drawn of what: sizes and bounds of drawings in recordings.


@dataclass(frozen=True, kw_only=True)
class DrawingOptions:
    """Bounds of what a recording draws.

    Up to ``matrix`` objectives every pair has a panel, beyond only neighbours; parallel coordinates come from
    ``parallel`` objectives on, and more than ``parallel_lines`` points are a grey area there. The timeline along the
    front has at most so many points, ``walk``, that along the starts of a plan so many, ``starts``. Of a plan's
    optima so many, ``optima``, are listed, and what so large a share of starts as ``near`` led to is on its axes. These
    reach ``better`` times as far beyond the best value as beyond the worst: starts that are better break limits.
    Timelines of generations play ``frames`` of them a second, those of a few things that are looked at one by one
    ``slow_frames``. Along a motion the arm stands in at least so many postures, ``motion_frames``.

    A limit is in the chart where it lies at most ``limit_distance`` ranges of the curves off, and counts as respected
    where it is passed by at most such a share of its range, ``limit_tolerance``. Errors below ``least_error`` are drawn
    as that, since their logarithm is. A value that is at most such a share of the largest, ``rounding``, is written as
    0. Meshes are drawn up to so many ``mesh_bytes``, since a recording holds them whole.
    """

    matrix: int = 5
    parallel: int = 3
    parallel_lines: int = 200
    walk: int = 60
    starts: int = 240
    optima: int = 12
    near: float = 0.9
    better: float = 0.1
    frames: float = 6.0
    slow_frames: float = 1.0
    motion_frames: int = 100
    limit_distance: float = 2.5
    limit_tolerance: float = 1e-6
    least_error: float = 1e-16
    rounding: float = 1e-10
    mesh_bytes: float = 40e6


@dataclass(frozen=True, kw_only=True)
class ViewSizes:
    """Sizes of views [pixels] in a viewer of 1600 by 900, which shows text in one size whatever its own is.

    ``width`` is the viewer's, ``cell`` that of a notebook's; ``body`` the height below the viewer's own bars, ``title``
    that of a view's title, ``columns`` the widths of the front, the arm and the words. ``panels`` and ``chart`` are
    width and height of what stands above and below in a column. Of a row of tabs the viewer takes ``tab_controls`` at
    its right end, and for each ``tab_margin`` around a name whose letters are ``tab_character`` wide.
    """

    width: float = 1600.0
    cell: float = 1000.0
    body: float = 830.0
    title: float = 24.0
    columns: tuple[float, float, float] = (600.0, 600.0, 400.0)
    panels: tuple[float, float] = (600.0, 500.0)
    chart: tuple[float, float] = (600.0, 236.0)
    tab_controls: float = 116.0
    tab_margin: float = 28.0
    tab_character: float = 6.4


@dataclass(frozen=True, kw_only=True)
class MarkSizes:
    """Sizes of marks and what stands around them, in pixels of the same viewer where nothing else is said.

    ``end`` is the radius of a best point, wider by ``ring`` around each mark on top of it. Labels stay ``clearance``
    off the middle of their mark and ``label_gap`` off others; those that find no room there go ``label_steps`` off, in
    heights of a label from the nearest place on, and ``outside`` is what leaving the frame counts, in marks that are
    covered: more than there ever are; so near as ``frame_gap`` to the frame counts as outside, and labels above it stay
    ``title_gap`` off what the axis upwards is called. Where none of these is free, a label goes to one of
    ``label_grid`` places across and down; what is farther off its mark than ``leader`` is joined to it by a line, which
    ends ``overlap`` within the label's plate. Labels keep off so many points of any line, ``line_points``.

    Curves are ``line`` wide, limits have dashes of ``dash``. Of a curve of dots more than ``many_dots`` are small; axes
    leave ``dot_margin`` of their range free on either side, so that none is cut. Arms of best points are ``arms`` wide
    and the chosen one on top ``solid_arm``, so that each is seen on the one before where they coincide; in space, where
    thin lines would hide in wide ones, ``spatial_arms``. Where a tool is to be is a ring with the radius
    ``target_ring``, around the tool. A start of a plan has the radius ``start``; beyond the axes it is a dash of
    ``edge_dash`` at their edge. On either side of a level ``band_margin`` are free of starts.
    """

    end: float = 5.2
    ring: float = 3.0
    clearance: float = 9.0
    label_steps: tuple[float, ...] = (1.0, 2.0, 3.5)
    outside: float = 1000.0
    label_gap: float = 4.0
    frame_gap: float = 3.0
    title_gap: float = 14.0
    label_grid: int = 12
    leader: float = 16.0
    overlap: float = 2.0
    line_points: int = 40
    line: float = 2.4
    dash: float = 7.0
    many_dots: int = 40
    solid_arm: float = 2.3
    arms: tuple[float, ...] = (4.1, 3.5, 2.9)
    spatial_arms: tuple[float, float] = (3.2, 1.6)
    start: float = 3.0
    edge_dash: float = 9.0
    target_ring: float = 11.0
    dot_margin: float = 0.02
    band_margin: float = 9.0


@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """Lengths in scenes of arms, as shares, since scenes have any size.

    ``arrow`` is how long the arrow of a direction is, of the arm's extent, ``cross`` how far the mark reaches of where
    a tool is to be; ``bead_gap`` how far beads of a path are apart, of the scene's; a link shorter than ``shortest`` of
    the longest joins joints in one place, and is none. The ground sign turns where the cosine between it and a link is
    above ``covered``: the link would lie over it. The grid of the ground has about so many lines a side, ``grid``; of
    more than ``ground_ticks`` every second has its words, which are not to touch far from the eye. A scene in space is
    seen from the direction of ``eye``, so near that all is in sight with a ``label_margin`` [pixels] on either side,
    across and upwards. The viewer's ``field_of_view`` [degrees] upwards was measured in a picture of it.
    """

    arrow: float = 0.25
    cross: float = 0.03
    bead_gap: float = 0.04
    shortest: float = 1e-6
    covered: float = 0.6
    grid: int = 7
    ground_ticks: int = 4
    eye: tuple[float, float, float] = (0.47, -0.8, 0.44)
    label_margin: tuple[float, float] = (38.0, 26.0)
    field_of_view: float = 55.0


DRAWING = DrawingOptions()
VIEWS = ViewSizes()
MARKS = MarkSizes()
SCENES = SceneOptions()


Colour: TypeAlias = tuple[int, int, int, int]


@dataclass(frozen=True, kw_only=True)
class PicturePalette:
    """Colours of pictures; ``accents`` are taken in turn.

    ``postures`` is how many of a motion are drawn, ``motions`` how many of a plan stand side by side.
    """

    ink: str = "#1f2933"
    quiet: str = "#7b8794"
    grid: str = "#e4e7eb"
    accents: tuple[str, ...] = ("#d9480f", "#0b7285", "#5f3dc4", "#2b8a3e")
    postures: int = 8
    motions: int = 3

    def accent(self, number: int) -> str:
        """Return the accent of a number, from the first again after the last."""
        return self.accents[number % len(self.accents)]

    @property
    def style(self) -> Any:
        """Settings of Matplotlib."""
        return {
            "font.size": 8.5,
            "text.color": self.ink,
            "axes.labelcolor": self.ink,
            "axes.edgecolor": self.quiet,
            "axes.linewidth": 0.7,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "axes.axisbelow": True,
            "axes.titlesize": 8.5,
            "grid.color": self.grid,
            "grid.linewidth": 0.7,
            "xtick.color": self.quiet,
            "ytick.color": self.quiet,
            "xtick.labelcolor": self.ink,
            "ytick.labelcolor": self.ink,
        }


@dataclass(frozen=True, kw_only=True)
class RecordingPalette:
    """Colours of recordings (RGBA); ``joints`` are taken in turn, ``ghosts`` is how many postures stay visible."""

    background: tuple[int, int, int] = (16, 18, 22)
    grid: Colour = (46, 50, 58, 255)
    frame: Colour = (104, 112, 124, 255)
    text: Colour = (200, 206, 216, 255)
    population: Colour = (125, 150, 185, 190)
    front: Colour = (255, 178, 62, 255)
    chosen: Colour = (70, 225, 190, 255)
    compared: Colour = (240, 110, 140, 255)
    failed: Colour = (225, 95, 95, 255)
    event: Colour = (255, 178, 62, 255)
    arm: Colour = (235, 238, 242, 255)
    ghost: Colour = (84, 93, 110, 255)
    predicted: Colour = (150, 158, 172, 255)
    path: Colour = (255, 178, 62, 255)
    tool: Colour = (70, 225, 190, 255)
    epsilon: Colour = (230, 215, 120, 255)
    moves: Colour = (200, 206, 216, 200)
    target: Colour = (150, 155, 165, 255)
    base: Colour = (150, 155, 165, 255)
    body: Colour = (78, 84, 94, 255)
    hull: Colour = (150, 160, 176, 70)
    final: Colour = (124, 88, 36, 255)
    obstacle: Colour = (205, 92, 92, 255)
    obstacle_body: Colour = (205, 92, 92, 110)
    limit: Colour = (200, 206, 216, 255)
    joints: tuple[Colour, ...] = (
        (255, 178, 62, 255),
        (70, 225, 190, 255),
        (110, 160, 255, 255),
        (240, 110, 140, 255),
        (190, 140, 255, 255),
        (160, 210, 90, 255),
        (230, 215, 120, 255),
        (140, 200, 230, 255),
    )
    ends: tuple[Colour, ...] = joints[2:]
    ghosts: int = 9

    def end(self, axis: int) -> Colour:
        """Return the colour of the best point of an objective, from the first again after the last."""
        return self.ends[axis % len(self.ends)]

    def joint(self, number: int) -> Colour:
        """Return the colour of a joint's curve, from the first again after the last."""
        return self.joints[number % len(self.joints)]


def objective_label(name: str, unit: str, maximised: bool) -> str:
    """Return the label of an objective's axis: its name, unit ([1] for none) and sense."""
    return f"{name} [{unit or '1'}]" + (", more is better" if maximised else "")


def screen_label(name: str, unit: str, maximised: bool) -> str:
    """Return the short label of an objective's axis on a screen: its name, unit, and an arrow where more is better."""
    return name + (f" [{unit}]" if unit else "") + (" ↑" if maximised else "")


PAPER = PicturePalette()
SCREEN = RecordingPalette()
