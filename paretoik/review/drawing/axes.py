"""Axes drawn by hand: Rerun has no scatter view, so a plane with a frame, ticks and labels replaces it.

A canvas maps a window of data onto a flat view whose second axis points down. Lengths on it are pixels of a viewer of
1600 by 900. Text has a fixed size on the screen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Mask, Values
from paretoik.review.palette import SCREEN, Colour

# Text that the viewer can show: it fails at a character that its only font (Inter) does not have.


SYMBOLS = frozenset("•…–—“”‰€−×·≤≥≈≠→←↑↓∂∞√∫∑●■▲○◆″°⁰ⁱ\n")


def screen_text(words: str) -> str:
    """Return `words` with a question mark for every character that the viewer cannot draw.

    >>> screen_text("energy [N²m²s], 能")
    'energy [N²m²s], ?'
    """
    blocks = (0x20, 0x7E), (0xA0, 0x24F), (0x391, 0x3CE), (0x410, 0x44F), (0x2080, 0x2089), (0x2074, 0x207B)
    drawable = SYMBOLS | {each for each in words if any(low <= ord(each) <= high for low, high in blocks)}
    return "".join(character if character in drawable else "?" for character in words)


def unbroken_units(words: str, units: Sequence[str]) -> str:
    r"""Return `words` in which no line ends between a number and its unit, or within a unit.

    >>> unbroken_units("it has 0.5 J s", ["J s"])
    'it has 0.5\xa0J\xa0s'
    """
    for unit in sorted(set(filter(None, units)), key=len, reverse=True):
        words = re.sub(rf"(?<=\d) {re.escape(unit)}", f"\u00a0{unit.replace(' ', chr(0xA0))}", words)
    return words


def entity_names(names: Sequence[str]) -> list[str]:
    """Return `names` as parts of entity paths: drawable, and still unique.

    >>> entity_names(["能", "量", "jerk"])
    ['?', '? (2)', 'jerk']
    """
    drawable = [screen_text(name) for name in names]
    before = [drawable[:place].count(name) for place, name in enumerate(drawable)]
    return [f"{name} ({count + 1})" if count else name for name, count in zip(drawable, before, strict=True)]


@dataclass(frozen=True, kw_only=True)
class TextSize:
    """Sizes of labels and margins around a canvas [pixels], as the viewer draws them.

    ``rise`` and ``gap`` keep words apart in smaller windows too, which draw the frame smaller, but not the words.
    """

    line: float = 20.0
    character: float = 6.5
    padding: float = 8.0  # width of the box behind a label, left plus right of the words
    drop: float = 12.0  # distance from a label's point down to its middle
    gap: float = 8.0  # distance between numbers and the frame
    rise: float = 21.0  # distance of the vertical axis label's middle above the frame
    row: float = 30.0  # height of a row of a legend
    left: float = 74.0
    right: float = 22.0
    top: float = 34.0
    bottom: float = 52.0


TEXT = TextSize()
COUNTED = ("level", "generation", "step", "refinement", "direction", "distinct optima", "points on the front")
Ticks = Float[np.ndarray, " _"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Canvas:
    """A window (corners ``low`` and ``high``) of a plane, drawn at ``origin`` with one label per axis."""

    low: Values
    high: Values
    labels: tuple[str, str]
    width: float = 500.0
    height: float = 390.0
    origin: Values = field(default_factory=lambda: np.zeros(2))
    ticked: tuple[bool, bool] = (True, True)  # whether each axis has ticks and a label, or a neighbour has them
    label_drop: float = 0.0  # distance that the lower label is moved down, away from a neighbour
    right_edge: float = np.inf  # right edge of the view: no label reaches beyond it
    overhang: float = np.inf  # largest distance that numbers of lower ticks reach beyond the frame
    side_room: float = 0.0  # free space to the right of the frame [pixels]

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on the view of `points` (..., 2)."""
        share = (points - self.low) / (self.high - self.low)
        x, y = self.origin[0] + share[..., 0] * self.width, self.origin[1] + (1.0 - share[..., 1]) * self.height
        return np.stack([x, y], axis=-1)

    def shows(self, points: np.ndarray) -> Mask:
        """Return which of `points` (points, 2) are in the window; NaN never is."""
        share = (points - self.low) / (self.high - self.low)
        inside: Mask = (np.abs(share - 0.5) <= 0.5).all(axis=-1)
        return inside

    def bounds(self, *, right: float = TEXT.right) -> rrb.VisualBounds2D:
        """Return the bounds of a view: the window and margins for its labels."""
        (x, y), size = self.origin, TEXT
        x_range = [x - size.left, x + self.width + right]
        return rrb.VisualBounds2D(x_range=x_range, y_range=[y - size.top, y + self.height + size.bottom])

    @property
    def upper_label_middle(self) -> Values:
        """The middle of the vertical axis label."""
        across = 0.5 * text_width(self.labels[1]) - 0.8 * TEXT.left
        return np.asarray(self.origin + np.array([across, -TEXT.rise]))

    def log(self, recording: rr.RecordingStream, entity: str) -> None:
        """Draw frame, grid, ticks and labels, for all times."""
        (x, y), (width, height), (low, high) = self.origin, (self.width, self.height), (self.low, self.high)
        across = fitting_ticks(low[0], high[0], room=width, size=lambda tick: text_width(tick_text(tick)))
        along = fitting_ticks(low[1], high[1], room=height, size=lambda _: 0.4 * TEXT.line)
        across, along = (
            ticks[np.abs(ticks - ticks.round()) < 1e-9] if label.startswith(COUNTED) else ticks
            for ticks, label in zip((across, along), self.labels, strict=True)
        )
        under = self.place(np.stack([across, np.full(len(across), low[1])], axis=-1))
        reach = np.array([0.5 * text_width(word) for word in tick_words(across)]) - self.overhang
        fits = (under[:, 0] - x >= reach) & (under[:, 0] - x <= width - reach)
        across, under = across[fits], under[fits]
        beside = self.place(np.stack([np.full(len(along), low[0]), along], axis=-1))

        upright = [[(tick, low[1]), (tick, high[1])] for tick in across]
        level = [[(low[0], tick), (high[0], tick)] for tick in along]
        corners = [low, (high[0], low[1]), high, (low[0], high[1]), low]
        strips = [self.place(np.array(strip)) for strip in (*upright, *level, corners)]
        colours = [SCREEN.grid] * (len(strips) - 1) + [SCREEN.frame]
        recording.log(f"{entity}/grid", flat_lines(strips, colours, 0.5, -10.0), static=True)

        words, places = list[str](), list[np.ndarray]()
        if self.ticked[0]:
            words = [*tick_words(across), self.labels[0]]
            middle = min(x + width / 2, self.right_edge - 0.5 * text_width(self.labels[0]) - 8.0)
            label = np.array([middle, y + height + 1.75 * TEXT.line + self.label_drop])
            places = [*(under + np.array([0.0, 0.7 * TEXT.line])), label]
        if self.ticked[1]:
            for word, place in zip(tick_words(along), beside, strict=True):
                middle = place - (0.5 * text_width(word) + TEXT.gap, 0.0)
                is_covered = any(  # in the corner: by the first horizontal tick
                    abs(middle[0] - other[0]) < 0.5 * (text_width(word) + text_width(said)) + TEXT.padding
                    and abs(middle[1] - other[1]) < 0.8 * TEXT.line
                    for said, other in zip(words, places, strict=True)
                )
                words, places = (words, places) if is_covered else ([*words, word], [*places, middle])
            words, places = [*words, self.labels[1]], [*places, self.upper_label_middle]
        recording.log(f"{entity}/labels", labels(words, np.array(places).reshape(-1, 2)), static=True)


def labels(
    words: Sequence[str], middles: Float[np.ndarray, "labels 2"], colours: Colour | Sequence[Colour] = SCREEN.text
) -> rr.Points2D:
    """Return words drawn around ``middles``."""
    drawn = [screen_text(each) for each in words]
    return flat_dots(middles - (0.0, TEXT.drop), colours, 0.0, -5.0, labels=drawn, show_labels=True)


def flat_lines(strips: Sequence[np.ndarray], colour: Any, radius: float, order: float, **more: Any) -> rr.LineStrips2D:
    """Return lines of a ``radius`` [pixels], drawn above everything of a lower ``order``."""
    return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order, **more)


def flat_dots(places: np.ndarray, colour: Any, radius: Any, order: float, **more: Any) -> rr.Points2D:
    """Return dots of one or several radii [pixels], drawn above everything of a lower ``order``."""
    return rr.Points2D(places, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order, **more)


def flat_view(entity: str, name: str, bounds: rrb.VisualBounds2D) -> rrb.View:
    """Return a view of a plane."""
    return rrb.Spatial2DView(origin=entity, name=name, visual_bounds=bounds, background=SCREEN.background)


def text_width(words: str) -> float:
    """Return the width of words [pixels]."""
    return TEXT.character * len(words)


def tick_text(tick: float) -> str:
    """Return the words of a tick."""
    return f"{tick:.6g}"


def tick_words(ticks: Ticks) -> list[str]:
    """Return the words of ticks; if some look equal, offsets from the first tick.

    >>> tick_words(np.array([7698.38, 7698.3801]))
    ['7698.38', '+0.0001']
    """
    words = [tick_text(tick) for tick in ticks]
    if len(set(words)) == len(words):
        return words
    return [words[0], *(f"+{tick - ticks[0]:.3g}" for tick in ticks[1:])]


def window(points: np.ndarray, *, margin: float = 0.06) -> tuple[Values, Values]:
    """Return the corners of a window around `points` (points, 2), wider by a `margin` of their range."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = axis_ranges(low, high)
    return low - margin * width, high + margin * width


def axis_ranges(low: Values, high: Values) -> Values:
    """Return the ranges of axes from `low` to `high`, without zeros.

    The range of a constant value is a tenth of it, or 1 if it is 0.
    A subnormal range counts as 0: there are no values to place between its ends.

    >>> axis_ranges(np.array([2.0, 5.0, 0.0, 2e-200]), np.array([3.0, 5.0, 0.0, 3e-200])).tolist()
    [1.0, 0.5, 1.0, 1e-200]
    """
    size, precision = np.maximum(np.abs(low), np.abs(high)), np.finfo(np.float64)
    ranges = np.where(high - low > 1e-9 * size, high - low, 0.1 * size)
    return np.asarray(np.where(size > precision.tiny / precision.eps, ranges, 1.0))


def equal_window(points: np.ndarray, *, width: float, height: float, margin: float = 0.08) -> tuple[Values, Values]:
    """Return corners around `points` (points, 2) that show both axes at one scale on `width` by `height`."""
    low, high = window(points, margin=margin)
    sides = np.array([width, height])
    half = ((high - low) / sides).max() * sides / 2
    return (low + high) / 2 - half, (low + high) / 2 + half


def fitting_ticks(low: float, high: float, *, room: float, size: Callable[[float], float]) -> Values:
    """Return round ticks in [low, high] whose labels, ``size(tick)`` pixels each, all fit into ``room``."""
    for count in range(6, 1, -1):
        ticks = nice_ticks(low, high, count=count)
        if len(ticks) < 2 or max(map(size, ticks)) + 0.8 * TEXT.line <= room * (ticks[1] - ticks[0]) / (high - low):
            return ticks
    return nice_ticks(low, high, count=1)


def nice_ticks(low: float, high: float, *, count: int = 5) -> Values:
    """Return multiples of 1, 2 or 5 times a power of ten in [low, high], about `count` at most."""
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough)
    ticks: Values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    return ticks + 0.0  # no tick at minus zero
