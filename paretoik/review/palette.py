"""Colours, sizes and labels: of pictures on paper, and of recordings on a screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Int


def even_rows(count: int, largest: int) -> Int[np.ndarray, " rows"]:
    """Return at most ``largest`` of ``count`` rows, evenly spread.

    >>> even_rows(9, 3).tolist(), even_rows(2, 3).tolist(), even_rows(0, 3).tolist()
    ([0, 4, 8], [0, 1], [])
    """
    return np.unique(np.linspace(0, count - 1, min(count, largest)).round().astype(np.int64))


# Recordings: how much is drawn, and the sizes.


@dataclass(frozen=True, kw_only=True)
class DrawingOptions:
    """Bounds of what a recording draws."""

    matrix: int = 5  # largest number of objectives with a panel for every pair; with more, only neighbours have one
    walk: int = 60  # largest number of points on the timeline along the front
    starts: int = 240  # largest number of starts on the timeline of a plan's starts
    optima: int = 12  # largest number of listed optima of a plan
    near: float = 0.9  # share of a plan's results that its axes contain
    better: float = 0.1  # margin of a plan's axes beyond the best value, as a share of the one beyond the worst
    frames: float = 6.0  # speed of timelines of generations [1/s]
    slow_frames: float = 1.0  # speed of other timelines that count, such as that of starts [1/s]
    motion_frames: int = 100  # smallest number of postures along a motion
    limit_distance: float = 2.5  # largest distance of a drawn limit from the curves, as a multiple of their range
    limit_tolerance: float = 1e-6  # excess up to which a limit counts as satisfied, as a share of its range
    least_error: float = 1e-16  # smallest drawn error, because errors are drawn as logarithms
    rounding: float = 1e-10  # share of the largest value up to which a value is written as 0
    mesh_bytes: float = 40e6  # largest total size of the meshes in a recording [bytes]


@dataclass(frozen=True, kw_only=True)
class ViewSizes:
    """Sizes of views [pixels] in a viewer of 1600 by 900, whose text has a fixed size."""

    width: float = 1600.0  # width of the viewer
    cell: float = 1000.0  # width of a notebook's cell
    body: float = 830.0  # height below the viewer's own bars
    title: float = 24.0  # height of a view's title
    columns: tuple[float, float, float] = (600.0, 600.0, 400.0)  # widths of the front, the arm and the texts
    panels: tuple[float, float] = (600.0, 500.0)  # width and height of the upper view in a column
    chart: tuple[float, float] = (600.0, 236.0)  # width and height of the lower view in a column
    tab_controls: float = 116.0  # width of the viewer's own buttons at the right end of a row of tabs
    tab_margin: float = 28.0  # width around the name of a tab
    tab_character: float = 6.4  # width of a letter in the name of a tab


@dataclass(frozen=True, kw_only=True)
class MarkSizes:
    """Sizes of marks and labels, in pixels of the same viewer unless it says otherwise."""

    end: float = 5.2  # radius of a best point
    ring: float = 3.0  # additional radius for each mark drawn on top
    clearance: float = 9.0  # distance between a label and the middle of its mark
    label_steps: tuple[float, ...] = (1.0, 2.0, 3.5)  # farther distances of labels, in heights of a label
    label_gap: float = 4.0  # distance between labels and other marks
    frame_gap: float = 3.0  # distance to the frame below which a label counts as outside
    title_gap: float = 14.0  # distance between labels above the frame and the vertical axis label
    label_grid: int = 12  # number of places per direction, tried if all nearer ones are taken
    leader: float = 16.0  # distance from its mark above which a label has a line to it
    overlap: float = 2.0  # length of this line within the label's plate
    line_points: int = 40  # number of points on a line that labels avoid
    line: float = 2.4  # width of curves
    dash: float = 7.0  # length of the dashes of limits
    many_dots: int = 40  # largest number of dots of a curve for which they are drawn large
    solid_arm: float = 2.3  # width of the chosen arm, drawn on top of ``arms``
    arms: tuple[float, ...] = (4.1, 3.5, 2.9)  # widths of the arms of best points, so that coinciding ones stay visible
    spatial_arms: tuple[float, float] = (3.2, 1.6)  # widths of the chosen and of other arms in space
    start: float = 3.0  # radius of a start of a plan
    edge_dash: float = 9.0  # length of the dash of a start beyond the axes
    target_ring: float = 11.0  # radius of the ring that marks the tool's target
    dot_margin: float = 0.02  # free share of the range on each side of dots, so that none is cut
    band_margin: float = 9.0  # free space on each side of a plan's level


@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """Sizes in scenes of arms, most of them as shares of the size of the scene."""

    arrow: float = 0.25  # length of the arrow of a direction, relative to the arm's extent
    cross: float = 0.03  # half size of the mark of a tool's target, relative to the arm's extent
    bead_gap: float = 0.04  # distance of the beads of a path, relative to the scene's extent
    shortest: float = 1e-6  # length up to which links are not drawn, as a share of the longest link
    covered: float = 0.6  # largest cosine between ground sign and link; above, the link would cover it, so it turns
    grid: int = 7  # approximate number of lines of the ground per side
    ground_ticks: int = 4  # largest number of ticks that all have words; with more, every second one has
    eye: tuple[float, float, float] = (0.47, -0.8, 0.44)  # direction from the scene to the eye
    label_margin: tuple[float, float] = (38.0, 26.0)  # margins for labels on each side, across and upwards [pixels]
    field_of_view: float = 55.0  # vertical field of view [degrees], measured in a picture of the viewer


DRAWING = DrawingOptions()
VIEWS = ViewSizes()
MARKS = MarkSizes()
SCENES = SceneOptions()


Colour: TypeAlias = tuple[int, int, int, int]


@dataclass(frozen=True, kw_only=True)
class PicturePalette:
    """Colours of pictures."""

    ink: str = "#1f2933"
    quiet: str = "#7b8794"
    grid: str = "#e4e7eb"
    accents: tuple[str, ...] = ("#d9480f", "#0b7285", "#5f3dc4", "#2b8a3e")  # used one after another
    postures: int = 8  # number of drawn postures of a motion
    motions: int = 3  # number of drawn motions of a plan

    def accent(self, number: int) -> str:
        """Return an accent colour by its number; the colours repeat."""
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
    """Colours of recordings (RGBA), and ``ghosts``, the number of postures drawn behind an arm."""

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
        """Return the colour of an objective's best point; the colours repeat."""
        return self.ends[axis % len(self.ends)]

    def joint(self, number: int) -> Colour:
        """Return the colour of a joint's curve; the colours repeat."""
        return self.joints[number % len(self.joints)]


def objective_label(name: str, unit: str, maximised: bool) -> str:
    """Return the label of an objective's axis: its name, unit ([1] for none) and sense."""
    return f"{name} [{unit or '1'}]" + (", more is better" if maximised else "")


def screen_label(name: str, unit: str, maximised: bool) -> str:
    """Return the short label of an objective's axis: its name, unit, and an arrow if more is better."""
    return name + (f" [{unit}]" if unit else "") + (" ↑" if maximised else "")


PAPER = PicturePalette()
SCREEN = RecordingPalette()
