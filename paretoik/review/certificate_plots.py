"""Pictures of what is certified: how objectives trade at every point, what is left to gain, who weighs how much."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.review.plots import ACCENTS, QUIET, STYLE, label, save

TANGENT = 0.06  # half its length, as a share of the picture's width or height
FLOOR = 1e-16  # where nothing is drawn that is smaller
CRITICAL, HOLDS = 1e-6, 1e-8
LOOKS: dict[str, Any] = {
    "minimum": {"color": ACCENTS[1], "marker": "o"},
    "saddle": {"color": ACCENTS[0], "marker": "X"},
    "undetermined": {"color": ACCENTS[0], "marker": "o", "markerfacecolor": "white"},
}
MOST_PAIRS = 3


def certificates_picture(front: Front, file: Path | str) -> None:
    """Write a PNG of a certified front: trade-offs with their exchange rates, residuals and weights of all points.

    The line through a point is the front's slope there, of two objectives with the others held.

    Raises
    ------
    InvalidInput
        The front has no certificates, or the file cannot be written.
    """
    if front.certificates is None:
        raise InvalidInput(
            "certificates_picture: a front with certificates wanted, got one without: pk.refine it first"
        )
    pairs = list(combinations(range(len(front.names)), 2))[:MOST_PAIRS]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(3.3 * (len(pairs) + 2), 3.2), dpi=125, layout="constrained")
        FigureCanvasAgg(figure)
        panels = np.atleast_1d(figure.subplots(1, len(pairs) + 2))
        for axes, pair in zip(panels, pairs, strict=False):
            _draw_trade(axes, front, pair)
        _draw_residuals(panels[-2], front)
        _draw_weights(panels[-1], front)
        save(figure, file)


def _draw_trade(axes: Axes, front: Front, pair: tuple[int, int]) -> None:
    known = front.certificates
    assert known is not None
    i, j = pair
    x, y = front.objectives[:, i], front.objectives[:, j]
    span = np.maximum([np.ptp(x), np.ptp(y)], 1e-300)
    slopes = known.exchange_rates[:, i, j]
    reach = TANGENT / np.hypot(1.0 / span[0], slopes / span[1])  # as long in the picture, whatever the slope
    for status, look in LOOKS.items():
        rows = known.status == status
        if not rows.any():
            continue
        axes.plot(x[rows], y[rows], linestyle="none", markersize=4, label=f"{rows.sum()} {status}", **look)
    for a, b, slope, step in zip(x, y, slopes, reach, strict=True):
        if np.isfinite(slope):
            axes.plot([a - step, a + step], [b - slope * step, b + slope * step], color=QUIET, linewidth=0.9, zorder=1)
    axes.set(xlabel=label(front, i), ylabel=label(front, j))
    axes.locator_params(nbins=5)
    axes.margins(0.12)
    axes.legend(frameon=False, handletextpad=0.2)


def _draw_residuals(axes: Axes, front: Front) -> None:
    known, places = front.certificates, np.arange(len(front))
    assert known is not None
    for values, name, colour in (
        (known.kkt_residual, "criticality", ACCENTS[1]),
        (known.violation, "violation", ACCENTS[0]),
        (known.violation_between, "between samples", QUIET),
    ):
        shown = values > FLOOR
        axes.plot(places[shown], values[shown], ".", color=colour, markersize=6, label=_told(name, int(shown.sum())))
    for goal, colour in ((CRITICAL, ACCENTS[1]), (HOLDS, ACCENTS[0])):
        axes.axhline(goal, color=colour, linewidth=0.7, linestyle=":")
    axes.set(yscale="log", xlabel="point", ylabel="share of a range", ylim=(FLOOR, 1.0), xlim=(-0.5, len(front) - 0.5))
    axes.legend(frameon=False, handletextpad=0.3)


def _told(name: str, shown: int) -> str:
    return name if shown else f"{name}: none"


def _draw_weights(axes: Axes, front: Front) -> None:
    known, places = front.certificates, np.arange(len(front))
    assert known is not None
    bottom = np.zeros(len(front))
    for k, name in enumerate(front.names):
        axes.bar(places, known.weights[:, k], bottom=bottom, width=0.9, color=ACCENTS[k % len(ACCENTS)], label=name)
        bottom = bottom + known.weights[:, k]
    axes.set(xlabel="point", ylabel="weight over its range", ylim=(0.0, 1.0), xlim=(-0.5, len(front) - 0.5))
    axes.grid(visible=False)
    axes.legend(frameon=True, framealpha=0.9, edgecolor="none", loc="upper center")
