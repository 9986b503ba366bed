"""Axes drawn by hand: Rerun has no scatter view, so a plane with a frame, ticks and labels stands in for one.

A canvas maps a window of data onto a flat view whose second axis points down. Lengths on it are pixels of a viewer of
1600 by 900, where text has its fixed size on the screen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Mask, Values
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.palette import SCREEN, Colour


@dataclass(frozen=True, kw_only=True)
class TextSize:
    """Sizes of labels and margins around a canvas [pixels], as the viewer draws them.

    Numbers end ``gap`` before the frame, the name of the axis upwards has its middle ``rise`` above it: enough that
    none touches where a smaller window draws the frame by a tenth smaller, and words as large as ever.
    """

    line: float = 20.0
    character: float = 6.5
    padding: float = 8.0  # of the box behind a label, left and right together
    drop: float = 12.0  # from a label's point down to its middle
    gap: float = 8.0
    rise: float = 21.0
    left: float = 74.0
    right: float = 22.0
    top: float = 34.0
    bottom: float = 52.0


TEXT = TextSize()
COUNTED = ("level", "generation", "step", "refinement", "direction", "distinct optima", "points on the front")
Ticks = Float[np.ndarray, " _"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Canvas:
    """A window (lower and upper corner) of a plane with a label an axis, ``width`` by ``height`` large at ``origin``.

    ``ticked`` says which axes have ticks and their label; without, a neighbour has them. ``label_drop`` moves the label
    below further down, out of a neighbour's way; no label reaches beyond the ``right_edge`` of the view, no number of a
    tick below farther than ``overhang`` beyond the frame. Right of the frame ``side_room`` [pixels] are free.
    """

    low: Values
    high: Values
    labels: tuple[str, str]
    width: float = 500.0
    height: float = 390.0
    origin: Values = field(default_factory=lambda: np.zeros(2))
    ticked: tuple[bool, bool] = (True, True)
    label_drop: float = 0.0
    right_edge: float = np.inf
    overhang: float = np.inf
    side_room: float = 0.0

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return where `points` (..., 2) lie on the view."""
        share = (points - self.low) / (self.high - self.low)
        x, y = self.origin[0] + share[..., 0] * self.width, self.origin[1] + (1.0 - share[..., 1]) * self.height
        return np.stack([x, y], axis=-1)

    def shows(self, points: np.ndarray) -> Mask:
        """Say which of `points` (points, 2) lie in the window; NaN never does."""
        share = (points - self.low) / (self.high - self.low)
        inside: Mask = (np.abs(share - 0.5) <= 0.5).all(axis=-1)
        return inside

    def fits(self, points: np.ndarray) -> bool:
        """Say whether all `points` (points, 2) lie in the window and fill more than half of either side."""
        return bool(self.shows(points).all() and (np.ptp(points, axis=0) > 0.5 * (self.high - self.low)).all())

    def bounds(self, *, right: float = TEXT.right) -> rrb.VisualBounds2D:
        """Return the bounds of a view: the window and margins for its labels."""
        (x, y), size = self.origin, TEXT
        x_range = [x - size.left, x + self.width + right]
        return rrb.VisualBounds2D(x_range=x_range, y_range=[y - size.top, y + self.height + size.bottom])

    @property
    def upper_label_end(self) -> float:
        """Where the label of the axis upwards ends, above the frame."""
        return float(self.origin[0] - 0.8 * TEXT.left + text_width(self.labels[1]))

    def log(self, recording: rr.RecordingStream, entity: str, *, static: bool) -> None:
        """Draw frame, grid, ticks and labels."""
        across, along = self._ticks()
        upright = [[(x, self.low[1]), (x, self.high[1])] for x in across]
        level = [[(self.low[0], y), (self.high[0], y)] for y in along]
        corners = [self.low, (self.high[0], self.low[1]), self.high, (self.low[0], self.high[1]), self.low]
        strips = [self.place(np.array(strip)) for strip in (*upright, *level, corners)]
        colours = [SCREEN.grid] * (len(strips) - 1) + [SCREEN.frame]
        grid = rr.LineStrips2D(strips, colors=colours, radii=rr.Radius.ui_points(0.5), draw_order=-10.0)
        recording.log(f"{entity}/grid", grid, static=static)
        words, places = self._labels(across, along)
        recording.log(f"{entity}/labels", labels(words, places), static=static)

    def _ticks(self) -> tuple[Ticks, Ticks]:
        upright = fitting_ticks(self.low[0], self.high[0], room=self.width, size=_width_of)
        level = fitting_ticks(self.low[1], self.high[1], room=self.height, size=lambda _: 0.4 * TEXT.line)
        upright = _countable(upright, self.labels[0])
        places = self.place(np.stack([upright, np.full(len(upright), self.low[1])], axis=-1))[:, 0] - self.origin[0]
        reaches = [0.5 * text_width(word) for word in tick_words(upright)]
        fits = [
            half - self.overhang <= place <= self.width + self.overhang - half
            for place, half in zip(places, reaches, strict=True)
        ]
        return upright[np.array(fits, dtype=bool)], _countable(level, self.labels[1])

    def _labels(self, across: Ticks, along: Ticks) -> tuple[list[str], np.ndarray]:
        """Return the words of ticks and axes, and where their middles are."""
        words, places = list[str](), list[np.ndarray]()
        (x, y), (width, height) = self.origin, (self.width, self.height)
        if self.ticked[0]:
            under = self.place(np.array([(tick, self.low[1]) for tick in across]).reshape(-1, 2))
            words += tick_words(across)
            places += [place + np.array([0.0, 0.7 * TEXT.line]) for place in under]
            words.append(self.labels[0])
            label_middle = min(x + width / 2, self.right_edge - 0.5 * text_width(self.labels[0]) - 8.0)
            places.append(np.array([label_middle, y + height + 1.75 * TEXT.line + self.label_drop]))
        if self.ticked[1]:
            tick_places = self.place(np.array([(self.low[0], tick) for tick in along]).reshape(-1, 2))
            tick_labels = tick_words(along)
            for word, place in zip(tick_labels, tick_places, strict=True):
                middle = place - (0.5 * text_width(word) + TEXT.gap, 0.0)
                if not _is_covered(word, middle, words, places):  # in the corner, by the first tick below
                    words.append(word)
                    places.append(middle)
            words.append(self.labels[1])
            places.append(np.array([x - 0.8 * TEXT.left + 0.5 * text_width(self.labels[1]), y - TEXT.rise]))
        return words, np.array(places).reshape(-1, 2)


def labels(
    words: Sequence[str], middles: Float[np.ndarray, "labels 2"], colours: Colour | Sequence[Colour] = SCREEN.text
) -> rr.Points2D:
    """Return words that are drawn around ``middles``."""
    return rr.Points2D(
        middles - (0.0, TEXT.drop),
        labels=[screen_text(each) for each in words],
        show_labels=True,
        colors=colours,
        radii=rr.Radius.ui_points(0.0),
        draw_order=-5.0,
    )


def _is_covered(word: str, middle: np.ndarray, words: Sequence[str], places: Sequence[np.ndarray]) -> bool:
    """Say whether the label of a word would overlap one of others, around their middles."""
    return any(
        abs(middle[0] - place[0]) < 0.5 * (text_width(word) + text_width(other)) + TEXT.padding
        and abs(middle[1] - place[1]) < 0.8 * TEXT.line
        for other, place in zip(words, places, strict=True)
    )


def text_width(words: str) -> float:
    """Return how wide words are [pixels]."""
    return TEXT.character * len(words)


def tick_text(tick: float) -> str:
    """Return the words of a tick."""
    return f"{tick:.6g}"


def tick_words(ticks: Ticks) -> list[str]:
    """Return the words of ticks; of those too close for their digits the first, and how far the others lie above it.

    >>> tick_words(np.array([7698.38, 7698.3801]))
    ['7698.38', '+0.0001']
    """
    words = [tick_text(tick) for tick in ticks]
    if len(set(words)) == len(words):
        return words
    return [words[0], *(f"+{tick - ticks[0]:.3g}" for tick in ticks[1:])]


def _countable(ticks: Ticks, label: str) -> Ticks:
    """Return the ticks of an axis; of one that counts the whole ones alone."""
    return ticks[np.abs(ticks - ticks.round()) < 1e-9] if label.startswith(COUNTED) else ticks


def _width_of(tick: float) -> float:
    return text_width(tick_text(tick))


def window(points: np.ndarray, *, margin: float = 0.06) -> tuple[Values, Values]:
    """Return the corners of a window around `points` (points, 2), wider by a `margin` of their range."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = axis_ranges(low, high)
    return low - margin * width, high + margin * width


def axis_ranges(low: Values, high: Values) -> Values:
    """Return the ranges of axes from `low` to `high`: of values that do not change a tenth of them, of zeros 1.

    Values so small that their differences are subnormal count as zeros: nothing can be placed between them.

    >>> axis_ranges(np.array([2.0, 5.0, 0.0, 2e-200]), np.array([3.0, 5.0, 0.0, 3e-200])).tolist()
    [1.0, 0.5, 1.0, 1e-200]
    """
    size, precision = np.maximum(np.abs(low), np.abs(high)), np.finfo(np.float64)
    ranges = np.where(high - low > 1e-9 * size, high - low, 0.1 * size)
    return np.asarray(np.where(size > precision.tiny / precision.eps, ranges, 1.0))


def equal_window(points: np.ndarray, *, width: float, height: float) -> tuple[Values, Values]:
    """Return corners around `points` (points, 2) that show both axes at one scale on `width` by `height`."""
    low, high = window(points, margin=0.08)
    sides = np.array([width, height])
    half = ((high - low) / sides).max() * sides / 2
    return (low + high) / 2 - half, (low + high) / 2 + half


def fitting_ticks(low: float, high: float, *, room: float, size: Callable[[float], float], largest: int = 6) -> Values:
    """Return round ticks inside [low, high] whose labels, ``size(tick)`` pixels each, all fit into ``room``."""
    for count in range(largest, 1, -1):
        ticks = nice_ticks(low, high, count=count)
        if len(ticks) < 2 or max(map(size, ticks)) + 0.8 * TEXT.line <= room * (ticks[1] - ticks[0]) / (high - low):
            return ticks
    return nice_ticks(low, high, count=1)


def nice_ticks(low: float, high: float, *, count: int = 5) -> Values:
    """Return multiples of 1, 2 or 5 times a power of ten inside [low, high], about `count` at most."""
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough)
    ticks: Values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    return ticks + 0.0  # no tick at minus zero
