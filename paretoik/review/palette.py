"""Colours, sizes and labels of what is drawn: one record for pictures on paper, one for recordings on a screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

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
