"""Pictures of certificates: exchange rates, residuals and weights of every point of a front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from paretoik.errors import InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.front import Front
from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import draw_jumps, label, picture, warn_below
from paretoik.review.words import describe_limits_between


@dataclass(frozen=True, kw_only=True)
class CertificateStyle:
    """Drawing options of certificates."""

    tangent: float = 0.06  # half length of an exchange rate's line, as a share of the picture's width or height
    floor: float = 1e-16  # least drawn residual
    critical: float = 1e-6  # largest residual of certified points
    feasible: float = 1e-8  # largest violation of certified points
    pairs: int = 3  # largest number of pairs of objectives with a panel
    markers: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: {
            "minimum": {"color": PAPER.accents[1], "marker": "o"},
            "saddle": {"color": PAPER.accents[0], "marker": "X"},
            "undetermined": {"color": PAPER.accents[0], "marker": "o", "markerfacecolor": "white"},
        }
    )


STYLE = CertificateStyle()


def certificates_picture(front: Front, file: Path | str) -> None:
    """Write a PNG of a certified front: exchange rates, residuals and weights of all points.

    The line through a point is the front's slope there in two objectives, with the others fixed. If motions exceed a
    limit between samples, a text says which, when, and what helps. Raises InvalidInput if the front has no
    certificates, or the file cannot be written.
    """
    if front.certificates is None:
        raise InvalidInput("certificates_picture: front must have certificates, got none: use pk.refine first")
    certificates = front.certificates
    pairs = list(combinations(range(len(front.names)), 2))[: STYLE.pairs]
    with picture(file, (3.3 * (len(pairs) + 2), 3.2)) as figure:
        panels = np.atleast_1d(figure.subplots(1, len(pairs) + 2))
        for axes, pair in zip(panels, pairs, strict=False):
            _draw_trade(axes, front, certificates, pair)
        _draw_residuals(panels[-2], certificates)
        _draw_weights(panels[-1], front.names, certificates)
        warn_below(figure, describe_limits_between(front))


def _draw_trade(axes: Axes, front: Front, certificates: Certificates, pair: tuple[int, int]) -> None:
    (i, j), (x, y) = pair, front.objectives[:, pair].T
    width = np.maximum([np.ptp(x), np.ptp(y)], 1e-300)
    slopes = certificates.exchange_rates[:, i, j]
    # same length in the picture for every slope
    half_length = STYLE.tangent / np.hypot(1.0 / width[0], slopes / width[1])
    for status, marker in STYLE.markers.items():
        rows = certificates.status == status
        if rows.any():
            axes.plot(x[rows], y[rows], linestyle="none", markersize=4, label=f"{rows.sum()} {status}", **marker)
    for a, b, slope, step in zip(x, y, slopes, half_length, strict=True):
        if np.isfinite(slope):
            ends = [a - step, a + step], [b - slope * step, b + slope * step]
            axes.plot(*ends, color=PAPER.quiet, linewidth=0.9, zorder=1)
    draw_jumps(axes, front)
    axes.set(xlabel=label(front, i), ylabel=label(front, j))
    axes.locator_params(nbins=5)
    axes.margins(0.12)
    axes.legend(frameon=False, handletextpad=0.2)


def _draw_residuals(axes: Axes, certificates: Certificates) -> None:
    places = np.arange(len(certificates))
    for values, name, colour in (
        (certificates.criticality, "criticality", PAPER.accents[1]),
        (certificates.violation, "violation", PAPER.accents[0]),
        (certificates.violation_between, "between samples", PAPER.quiet),
    ):
        shown = values > STYLE.floor
        legend = name if shown.any() else f"{name}: none"
        axes.plot(places[shown], values[shown], ".", color=colour, markersize=6, label=legend)
    for tolerance, colour in ((STYLE.critical, PAPER.accents[1]), (STYLE.feasible, PAPER.accents[0])):
        axes.axhline(tolerance, color=colour, linewidth=0.7, linestyle=":")
    ranges: Any = {"ylim": (STYLE.floor, 1.0), "xlim": (-0.5, len(places) - 0.5)}
    axes.set(yscale="log", xlabel="point", ylabel="share of a range", **ranges)
    axes.legend(frameon=False, handletextpad=0.3)


def _draw_weights(axes: Axes, names: Sequence[str], certificates: Certificates) -> None:
    places, bottom = np.arange(len(certificates)), np.zeros(len(certificates))
    for k, (name, weights) in enumerate(zip(names, certificates.weights.T, strict=True)):
        axes.bar(places, weights, bottom=bottom, width=0.9, color=PAPER.accent(k), label=name)
        bottom = bottom + weights
    axes.set(xlabel="point", ylabel="weight over its range", ylim=(0.0, 1.0), xlim=(-0.5, len(places) - 0.5))
    axes.grid(visible=False)
    axes.legend(frameon=True, framealpha=0.9, edgecolor="none", loc="upper center")
