"""Axes drawn by hand: Rerun has no scatter view, so a plane with a frame, ticks and labels stands in for one.

A canvas maps a window of data onto a flat view whose second axis points down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Mask, Values
from paretoik.review.palette import SCREEN


@dataclass(frozen=True, kw_only=True, eq=False)
class Canvas:
    """A window (lower and upper corner) of a plane with a label an axis, drawn ``width`` by ``height``.

    ``text`` is the height of a line of text in the same lengths: it has a fixed size on the screen, so it takes more of
    a small panel than of a large one.
    """

    low: Values
    high: Values
    labels: tuple[str, str]
    width: float = 140.0
    height: float = 100.0
    text: float = 3.2

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return where `points` (..., 2) lie on the view."""
        share = (points - self.low) / (self.high - self.low)
        return np.stack([share[..., 0] * self.width, (1.0 - share[..., 1]) * self.height], axis=-1)

    def shows(self, points: np.ndarray) -> Mask:
        """Say which of `points` (points, 2) lie in the window; NaN never does."""
        share = (points - self.low) / (self.high - self.low)
        inside: Mask = (np.abs(share - 0.5) <= 0.5).all(axis=-1)
        return inside

    def fits(self, points: np.ndarray) -> bool:
        """Say whether all `points` (points, 2) lie in the window and fill more than half of either side."""
        return bool(self.shows(points).all() and (np.ptp(points, axis=0) > 0.5 * (self.high - self.low)).all())

    def bounds(self) -> rrb.VisualBounds2D:
        """Return the bounds of a view: the window and a margin for its labels."""
        x_range = [-6.0 * self.text, self.width + 2.5 * self.text]
        return rrb.VisualBounds2D(x_range=x_range, y_range=[-4.0 * self.text, self.height + 6.5 * self.text])

    def log(self, recording: rr.RecordingStream, entity: str, *, static: bool) -> None:
        """Draw frame, grid, ticks and labels."""
        across, along = (
            nice_ticks(low, high, count=int(np.clip(side / (5.5 * self.text), 3, 6)))
            for low, high, side in zip(self.low, self.high, (self.width, 1.4 * self.height), strict=True)
        )
        upright = [[(x, self.low[1]), (x, self.high[1])] for x in across]
        level = [[(self.low[0], y), (self.high[0], y)] for y in along]
        corners = [self.low, (self.high[0], self.low[1]), self.high, (self.low[0], self.high[1]), self.low]
        strips = [self.place(np.array(strip)) for strip in (*upright, *level, corners)]
        colours = [SCREEN.grid] * (len(strips) - 1) + [SCREEN.frame]
        grid = rr.LineStrips2D(strips, colors=colours, radii=rr.Radius.ui_points(0.5), draw_order=-10.0)
        recording.log(f"{entity}/grid", grid, static=static)
        # A label hangs centred under its point, so those beside the frame are raised by a line.
        under = self.place(np.array([(x, self.low[1]) for x in across])) + np.array([0.0, 0.3 * self.text])
        beside = self.place(np.array([(self.low[0], y) for y in along])) - np.array([2.8 * self.text, 1.2 * self.text])
        names = np.array(
            [[self.width / 2, self.height + 3.2 * self.text], [0.3 * len(self.labels[1]) * self.text, -3.2 * self.text]]
        )
        text = rr.Points2D(
            np.concatenate([under, beside, names]),
            labels=[f"{tick:.6g}" for tick in (*across, *along)] + list(self.labels),
            show_labels=True,
            colors=SCREEN.text,
            radii=rr.Radius.ui_points(0.0),
            draw_order=-5.0,
        )
        recording.log(f"{entity}/labels", text, static=static)


def window(points: np.ndarray, *, margin: float = 0.06) -> tuple[Values, Values]:
    """Return the corners of a window around `points` (points, 2), wider by a `margin` of their range."""
    low, high = points.min(axis=0), points.max(axis=0)
    width = np.where(high - low > 1e-9 * np.abs(high), high - low, np.maximum(0.1 * np.abs(high), 1e-9))
    return low - margin * width, high + margin * width


def equal_window(points: np.ndarray, *, width: float, height: float) -> tuple[Values, Values]:
    """Return corners around `points` (points, 2) that show both axes at one scale on `width` by `height`."""
    low, high = window(points, margin=0.08)
    sides = np.array([width, height])
    half = ((high - low) / sides).max() * sides / 2
    return (low + high) / 2 - half, (low + high) / 2 + half


def nice_ticks(low: float, high: float, *, count: int = 5) -> Values:
    """Return multiples of 1, 2 or 5 times a power of ten inside [low, high], about `count` at most."""
    rough = (high - low) / count
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough)
    ticks: Values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    return ticks + 0.0  # no tick at minus zero
