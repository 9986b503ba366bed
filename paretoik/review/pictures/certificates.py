"""Pictures of certificates: exchange rates, residuals and weights of every point of a front."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput
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
    limit between samples, a text says which limit, when, and what helps. Raises InvalidInput if the front has no
    certificates, or the file cannot be written.
    """
    if front.certificates is None:
        raise InvalidInput("certificates_picture: front must have certificates, got none: use pk.refine first")
    certificates, places = front.certificates, np.arange(len(front))
    pairs = list(combinations(range(len(front.names)), 2))[: STYLE.pairs]
    with picture(file, (3.3 * (len(pairs) + 2), 3.2)) as figure:
        *trades, residuals, weights = np.atleast_1d(figure.subplots(1, len(pairs) + 2))
        for axes, (i, j) in zip(trades, pairs, strict=True):  # two objectives, with a line for every exchange rate
            (x, y), slopes = front.objectives[:, [i, j]].T, certificates.exchange_rates[:, i, j]
            width = np.maximum([np.ptp(x), np.ptp(y)], 1e-300)
            # all lines have the same length in the picture
            half_length = STYLE.tangent / np.hypot(1.0 / width[0], slopes / width[1])
            for status, marker in STYLE.markers.items():
                rows = certificates.status == status
                if rows.any():
                    said = f"{rows.sum()} {status}"
                    axes.plot(x[rows], y[rows], linestyle="none", markersize=4, label=said, **marker)
            for a, b, slope, step in zip(x, y, slopes, half_length, strict=True):
                if np.isfinite(slope):
                    ends = [a - step, a + step], [b - slope * step, b + slope * step]
                    axes.plot(*ends, color=PAPER.quiet, linewidth=0.9, zorder=1)
            draw_jumps(axes, front)
            axes.set(xlabel=label(front, i), ylabel=label(front, j))
            axes.locator_params(nbins=5)
            axes.margins(0.12)
            axes.legend(frameon=False, handletextpad=0.2)
        for values, name, colour in (
            (certificates.criticality, "criticality", PAPER.accents[1]),
            (certificates.violation, "violation", PAPER.accents[0]),
            (certificates.violation_between, "between samples", PAPER.quiet),
        ):
            shown = values > STYLE.floor
            legend = name if shown.any() else f"{name}: none"
            residuals.plot(places[shown], values[shown], ".", color=colour, markersize=6, label=legend)
        for tolerance, colour in ((STYLE.critical, PAPER.accents[1]), (STYLE.feasible, PAPER.accents[0])):
            residuals.axhline(tolerance, color=colour, linewidth=0.7, linestyle=":")
        ranges: Any = {"ylim": (STYLE.floor, 1.0), "xlim": (-0.5, len(places) - 0.5)}
        residuals.set(yscale="log", xlabel="point", ylabel="share of a range", **ranges)
        residuals.legend(frameon=False, handletextpad=0.3)
        bottom = np.zeros(len(places))
        for k, (name, values) in enumerate(zip(front.names, certificates.weights.T, strict=True)):
            weights.bar(places, values, bottom=bottom, width=0.9, color=PAPER.accent(k), label=name)
            bottom = bottom + values
        weights.set(xlabel="point", ylabel="weight over its range", ylim=(0.0, 1.0), xlim=(-0.5, len(places) - 0.5))
        weights.grid(visible=False)
        weights.legend(frameon=True, framealpha=0.9, edgecolor="none", loc="upper center")
        warn_below(figure, describe_limits_between(front))
