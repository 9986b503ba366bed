"""A picture of fronts side by side, with what runs of one method attain."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from paretoik.front.comparison import Comparison
from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import label, picture

MARKERS = "osD^vP*X"


def comparison_picture(comparison: Comparison, file: Path | str) -> None:
    """Write a PNG of fronts in one picture, a colour a label, with the hypervolume of each.

    Of two objectives, labels with several runs get the surfaces that one run, half of them and all attain; more than
    three objectives are parallel coordinates, the best of the merged front below. Raises InvalidInput where writing
    fails.
    """
    n_obj = len(comparison.fronts[0].names)
    wide = 9.6 if n_obj > 2 else 6.6
    with picture(file, (wide, 4.2)) as figure:
        if n_obj == 1:
            _draw_values(figure.subplots(), comparison)
        elif n_obj > 3:
            _draw_parallel(figure.subplots(), comparison)
        else:
            pairs = list(combinations(range(n_obj), 2))
            for axes, pair in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
                _draw_pair(axes, comparison, pair)
        handles, names = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False, fontsize=8)


def _styles(comparison: Comparison) -> list[dict[str, Any]]:
    """Return how each front is drawn, and what is said of it."""
    order = list(comparison.groups)
    styles = []
    for place, (name, volume) in enumerate(zip(comparison.labels, comparison.hypervolume, strict=True)):
        group = comparison.groups[name]
        words = f"{name}: hypervolume {volume:.4f}"
        if len(group) > 1:
            words = f"{name}: {len(group)} runs, median hypervolume {np.median(comparison.hypervolume[group]):.4f}"
        shape, colour = MARKERS[order.index(name) % len(MARKERS)], PAPER.accent(order.index(name))
        styles.append({"color": colour, "marker": shape, "label": words if place == group[0] else None})
    return styles


def _draw_pair(axes: Axes, comparison: Comparison, pair: tuple[int, int]) -> None:
    for front, style in zip(comparison.fronts, _styles(comparison), strict=True):
        x, y = front.objectives[:, pair[0]], front.objectives[:, pair[1]]
        axes.plot(x, y, linestyle="none", markersize=4, markeredgewidth=0, alpha=0.75, **style)
    if len(comparison.fronts[0].names) == 2:
        _draw_surfaces(axes, comparison)
    first = comparison.fronts[0]
    axes.set(xlabel=label(first, pair[0]), ylabel=label(first, pair[1]))
    axes.locator_params(nbins=5)
    axes.margins(0.06)


def _draw_surfaces(axes: Axes, comparison: Comparison) -> None:
    """Draw for each label with several runs the surfaces that the best, the median and the worst attain."""
    window = np.stack([np.ptp(values) * 0.06 for values in np.concatenate([f.objectives for f in comparison.fronts]).T])
    ends = np.concatenate([front.minimised for front in comparison.fronts]).max(axis=0) + window
    for name in (name for name, places in comparison.groups.items() if len(places) > 1):
        colour = PAPER.accent(list(comparison.groups).index(name))
        for (words, surface), line in zip(comparison.surfaces(name).items(), (":", "-", "--"), strict=True):
            x, y = _staircase(comparison, surface, ends).T
            text = f"{name}: {words} attainment"
            axes.plot(x, y, linestyle=line, color=colour, linewidth=1.1, label=text, zorder=1)


def _staircase(
    comparison: Comparison, surface: Float[np.ndarray, "points 2"], ends: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, "corners 2"]:
    """Return the border of what a surface of two objectives dominates, up to ``ends``, in the user's own sign."""
    sign = np.where(comparison.fronts[0].maximised, -1.0, 1.0)
    points = surface * sign
    points = points[np.argsort(points[:, 0], kind="stable")]
    x = np.repeat([*points[:, 0], ends[0]], 2)[:-1]
    y = np.repeat([ends[1], *points[:, 1]], 2)[1:]
    return np.stack([x, y], axis=1) * sign


def _draw_values(axes: Axes, comparison: Comparison) -> None:
    for place, (front, style) in enumerate(zip(comparison.fronts, _styles(comparison), strict=True)):
        axes.plot(front.objectives[:, 0], np.full(len(front), place), linestyle="none", markersize=6, **style)
    axes.set(xlabel=label(comparison.fronts[0], 0), yticks=range(len(comparison.labels)))
    axes.set_yticklabels([name.replace("$", r"\$") for name in comparison.labels])
    axes.margins(0.2)


def _draw_parallel(axes: Axes, comparison: Comparison) -> None:
    first = comparison.fronts[0]
    places = np.arange(len(first.names))
    for shares, style in zip(comparison.shares, _styles(comparison), strict=True):
        lines = {"color": style["color"], "alpha": 0.35, "linewidth": 0.8}
        axes.plot(places, shares.T, **lines)
        axes.plot([], [], color=style["color"], label=style["label"])
    axes.set_xticks(places, [label(first, axis) for axis in range(len(places))])
    axes.set(ylabel="share of the merged front's range, best below")
