"""Axes drawn by hand: Rerun has no scatter view, so a plane with a frame, ticks and labels replaces it.

A canvas maps a window of data onto a flat view whose second axis points down. Lengths on it are pixels of a viewer of
1600 by 900. Text has a fixed size on the screen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int

from paretoik.arrays import Mask, Objectives, Values
from paretoik.review.palette import DRAWING, SCREEN, VIEWS, Colour, even_rows

# Text as the viewer can show it: it stops at a character that its only font (Inter) does not have.


SYMBOLS = frozenset("•…–—“”‰€−×·≤≥≈≠→←↑↓∂∞√∫∑●■▲○◆″°⁰ⁱ\n")
BLOCKS = ((0x20, 0x7E), (0xA0, 0x24F), (0x391, 0x3CE), (0x410, 0x44F), (0x2080, 0x2089), (0x2074, 0x207B))


def screen_text(words: str) -> str:
    """Return `words` with a question mark for every character that the viewer cannot draw.

    >>> screen_text("energy [N²m²s], 能")
    'energy [N²m²s], ?'
    """
    drawable = SYMBOLS | {
        character for character in words if any(low <= ord(character) <= high for low, high in BLOCKS)
    }
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


# Axes with ticks and labels.


@dataclass(frozen=True, kw_only=True)
class TextSize:
    """Sizes of labels and margins around a canvas [pixels], as the viewer draws them.

    ``rise`` and ``gap`` keep words apart in a smaller window too, which draws the frame a tenth smaller but words at
    the same size.
    """

    line: float = 20.0
    character: float = 6.5
    padding: float = 8.0  # of the box behind a label, left plus right
    drop: float = 12.0  # from a label's point down to its middle
    gap: float = 8.0  # between numbers and the frame
    rise: float = 21.0  # of the middle of the vertical axis label above the frame
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
    ticked: tuple[bool, bool] = (True, True)  # which axes have ticks and a label; a neighbour has the others
    label_drop: float = 0.0  # how far the lower label is moved down, away from a neighbour
    right_edge: float = np.inf  # of the view: no label reaches beyond it
    overhang: float = np.inf  # how far a number of a lower tick may reach beyond the frame
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

    def fits(self, points: np.ndarray) -> bool:
        """Return whether all `points` (points, 2) are in the window and fill more than half of each side."""
        return bool(self.shows(points).all() and (np.ptp(points, axis=0) > 0.5 * (self.high - self.low)).all())

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
        upright = fitting_ticks(
            self.low[0], self.high[0], room=self.width, size=lambda tick: text_width(tick_text(tick))
        )
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
        """Return the words of ticks and axes, and their middles."""
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
                if not _is_covered(word, middle, words, places):  # in the corner, by the first horizontal tick
                    words.append(word)
                    places.append(middle)
            words.append(self.labels[1])
            places.append(self.upper_label_middle)
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
    """Return whether the label of a word would overlap another label, given all middles."""
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
    """Return the words of ticks; if too close for their digits, the first and the offsets of the others.

    >>> tick_words(np.array([7698.38, 7698.3801]))
    ['7698.38', '+0.0001']
    """
    words = [tick_text(tick) for tick in ticks]
    if len(set(words)) == len(words):
        return words
    return [words[0], *(f"+{tick - ticks[0]:.3g}" for tick in ticks[1:])]


def _countable(ticks: Ticks, label: str) -> Ticks:
    """Return the ticks of an axis; only whole ones if it counts."""
    return ticks[np.abs(ticks - ticks.round()) < 1e-9] if label.startswith(COUNTED) else ticks


def window(points: np.ndarray, *, margin: float = 0.06) -> tuple[Values, Values]:
    """Return the corners of a window around `points` (points, 2), wider by a `margin` of their range."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = axis_ranges(low, high)
    return low - margin * width, high + margin * width


def axis_ranges(low: Values, high: Values) -> Values:
    """Return the ranges of axes from `low` to `high`; for a constant, a tenth of it, and for zeros 1.

    Values with subnormal differences count as zeros: nothing can be placed between them.

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


def fitting_ticks(low: float, high: float, *, room: float, size: Callable[[float], float], largest: int = 6) -> Values:
    """Return round ticks in [low, high] whose labels, ``size(tick)`` pixels each, all fit into ``room``."""
    for count in range(largest, 1, -1):
        ticks = nice_ticks(low, high, count=count)
        if len(ticks) < 2 or max(map(size, ticks)) + 0.8 * TEXT.line <= room * (ticks[1] - ticks[0]) / (high - low):
            return ticks
    return nice_ticks(low, high, count=1)


def nice_ticks(low: float, high: float, *, count: int = 5) -> Values:
    """Return multiples of 1, 2 or 5 times a power of ten in [low, high], about `count` at most."""
    step = _nice_step((high - low) / count)
    ticks: Values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    return ticks + 0.0  # no tick at minus zero


def round_ends(low: float, high: float, *, count: int = 40) -> tuple[float, float]:
    """Return the nearest multiples of a round step around [low, high]; the step is about a `count`-th of it.

    >>> round_ends(721.3, 1629.4)
    (700.0, 1650.0)
    """
    step = _nice_step((high - low) / count)
    return float(np.floor(low / step + 1e-9) * step) + 0.0, float(np.ceil(high / step - 1e-9) * step) + 0.0


def _nice_step(rough: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at least `rough` except for rounding."""
    power = 10.0 ** np.floor(np.log10(rough))
    return float(power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough))


# Parallel coordinates: one axis per objective, and one line per point across them.


@dataclass(frozen=True, kw_only=True, eq=False)
class ParallelAxes:
    """The axes of objectives with ``labels`` between ``low`` and ``high`` (n_obj,), drawn at ``entity``."""

    entity: str
    labels: tuple[str, ...]
    low: Values
    high: Values

    @staticmethod
    def around(entity: str, labels: tuple[str, ...], shown: Objectives) -> ParallelAxes:
        """Return axes that contain all of `shown` (points, n_obj), at least one point; inner ones have round ends."""
        low, high = shown.min(axis=0), shown.max(axis=0)
        margin = 0.04 * axis_ranges(low, high)
        low, high = low - margin, high + margin
        for axis in range(1, len(labels) - 1):
            low[axis], high[axis] = round_ends(low[axis], high[axis])
        return ParallelAxes(entity=entity, labels=labels, low=low, high=high)

    def view(self) -> rrb.View:
        """Return the view."""
        y_range = [-TEXT.top - self._above - self._stagger, self._height + self._below]
        bounds = rrb.VisualBounds2D(x_range=[-TEXT.left, VIEWS.chart[0] - TEXT.left], y_range=y_range)
        return rrb.Spatial2DView(
            origin=self.entity, name="parallel coordinates", visual_bounds=bounds, background=SCREEN.background
        )

    def log(self, recording: rr.RecordingStream, *, static: bool) -> None:
        """Draw axes, ticks and labels; numbers are only on the outer sides, as lines run between axes.

        Inner axes have ticks and numbers only at their ends.
        """
        strips, words, places = list[np.ndarray](), list[str](), list[tuple[float, float]]()
        for axis, (x, low, high) in enumerate(zip(self._x, self.low, self.high, strict=True)):
            strips.append(np.array([(x, 0.0), (x, self._height)]))
            outer = axis in (0, len(self.labels) - 1)
            ticks = np.array([low, high])
            if outer:
                ticks = fitting_ticks(low, high, room=self._height, size=lambda _: 0.6 * TEXT.line, largest=5)
            side = -1.0 if axis == 0 else 1.0
            for tick, word in zip(ticks, tick_words(ticks), strict=True):
                y = float(self._upwards(np.array(tick), low, high))
                strips.append(np.array([(x - 4.0, y), (x + 4.0, y)]))
                words.append(word)
                beyond = -0.6 if tick == high else 0.6
                places.append((x + side * (10.0 + 0.5 * text_width(word)), y) if outer else (x, y + beyond * TEXT.line))
            words.append(self.labels[axis])
            last = self._x[-1] + 0.8 * TEXT.left - 0.5 * text_width(words[-1])
            middle = min(max(x, 0.5 * text_width(words[-1]) - 0.85 * TEXT.left), last) if len(self._x) > 1 else x
            places.append((middle, -0.95 * TEXT.line - self._above - self._stagger * (axis % 2)))
        grid = rr.LineStrips2D(strips, colors=SCREEN.frame, radii=rr.Radius.ui_points(0.8), draw_order=3.0)
        recording.log(f"{self.entity}/axes/lines", grid, static=static)
        recording.log(f"{self.entity}/axes/labels", labels(words, np.array(places)), static=static)

    def lines(self, F: Objectives, colour: Colour, radius: float, order: float) -> rr.LineStrips2D:
        """Return one line per point of F (points, n_obj), evenly picked ones of many."""
        finite = F[np.isfinite(F).all(axis=1)]
        inside = finite[((finite >= self.low) & (finite <= self.high)).all(axis=1)]
        heights = self._upwards(inside[drawn_rows(len(inside))], self.low, self.high)
        strips = [np.stack([self._x, each], axis=1) for each in heights]
        return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order)

    def _upwards(self, values: np.ndarray, low: float | Values, high: float | Values) -> np.ndarray:
        return np.asarray((1.0 - (values - low) / (high - low)) * self._height)

    @property
    def _x(self) -> Values:
        return np.linspace(0.0, VIEWS.chart[0] - TEXT.left - 56.0, len(self.labels))

    @property
    def _height(self) -> float:
        return VIEWS.chart[1] - TEXT.top - self._above - self._stagger - self._below

    @property
    def _below(self) -> float:
        """The height of the words at the lower ends of inner axes."""
        return 1.3 * TEXT.line

    @property
    def _above(self) -> float:
        """The height of the words at the upper ends of inner axes."""
        return TEXT.line if len(self.labels) > 2 else 0.0

    @property
    def _stagger(self) -> float:
        """How far every second label is moved up if neighbours would overlap."""
        room = VIEWS.chart[0] / len(self.labels)
        return TEXT.line if TEXT.character * max(map(len, self.labels)) > room - 10.0 else 0.0


def drawn_rows(count: int) -> Int[np.ndarray, " rows"]:
    """Return the rows, among ``count`` points, that have a line."""
    return even_rows(count, DRAWING.parallel_lines)
