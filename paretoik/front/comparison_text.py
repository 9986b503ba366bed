"""A comparison of fronts in words and tables, for a terminal and for a notebook."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.front.comparison import ATTAINABLE, Comparison
from paretoik.tables import columns, html_table, html_text

COVERAGE = "coverage: the share of a column's points that some point of the row weakly dominates"
EPSILON = "additive epsilon: by how much the row must improve to weakly dominate the column, in shares of the ranges"
DIFFERENT = "what differs in how they were made"


def comparison_text(comparison: Comparison) -> str:
    """Return the comparison as a normalisation in words and aligned tables."""
    parts = [_normalisation(comparison)]
    for title, rows in _tables(comparison):
        parts.append("\n".join([title, columns(rows)] if title else [columns(rows)]))
    return "\n\n".join(parts)


def comparison_html(comparison: Comparison) -> str:
    """Return the comparison as HTML without scripts."""
    tables = "".join(html_table(rows, caption=title) for title, rows in _tables(comparison))
    return f"<div>{html_text(_normalisation(comparison))}{tables}</div>"


def comparison_entries(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as data: what JSON can hold."""
    front = comparison.fronts[0]
    return {
        "objectives": [
            {"name": name, "unit": unit, "maximised": maximised, "best": best, "worst": worst}
            for name, unit, maximised, (best, worst) in zip(
                front.names, front.units, front.maximised, comparison.ranges, strict=True
            )
        ],
        "labels": comparison.labels,
        "points": comparison.points,
        "on_merged": comparison.on_merged,
        "hypervolume": comparison.hypervolume,
        "coverage": comparison.coverage,
        "epsilon": comparison.epsilon,
        "attainment": _attainment(comparison),
        "differences": comparison.differences,
    }


def _attainment(comparison: Comparison) -> dict[str, Any] | None:
    """Return the surfaces of all runs, and of each label that has several; None where there are none to compute."""
    if len(comparison.fronts[0].names) not in ATTAINABLE:
        return None
    several = [label for label, places in comparison.groups.items() if len(places) > 1]
    return {"all": comparison.surfaces(), "labels": {label: comparison.surfaces(label) for label in several}}


def _normalisation(comparison: Comparison) -> str:
    front = comparison.fronts[0]
    ranges = ", ".join(
        f"{front.quantity(axis, best)} to {front.quantity(axis, worst).removeprefix(front.names[axis]).lstrip()}"
        for axis, (best, worst) in enumerate(comparison.ranges)
    )
    return (
        f"Shares are of the ranges of the merged front, best to worst: {ranges}.\n"
        "Hypervolume is that up to 1.1 of each range, over that of the merged front."
    )


def _tables(comparison: Comparison) -> list[tuple[str, list[list[str]]]]:
    """Return the tables with their titles: points and hypervolume, coverage, epsilon, settings that differ."""
    names = _distinct(comparison.labels)
    rows = [["front", "points", "on the merged front", "hypervolume"]]
    for name, points, shared, volume in zip(
        names, comparison.points, comparison.on_merged, comparison.hypervolume, strict=True
    ):
        rows.append([name, str(points), str(shared), f"{volume:.4f}"])
    merged = sum(len(part) for part in comparison.merged_rows)
    rows.append(["merged", str(merged), str(merged), "1.0000"])
    tables = [("", rows), (COVERAGE, _pairs(names, comparison.coverage)), (EPSILON, _pairs(names, comparison.epsilon))]
    runs = {label: places for label, places in comparison.groups.items() if len(places) > 1}
    if runs:
        tables.append(("runs with one label", _runs(comparison, runs)))
    if comparison.differences:
        tables.append((DIFFERENT, [["", *names], *([name, *each] for name, each in comparison.differences.items())]))
    return tables


def _runs(comparison: Comparison, runs: dict[str, list[int]]) -> list[list[str]]:
    rows = [["label", "runs", "hypervolume: median", "worst", "best"]]
    for label, places in runs.items():
        volumes = comparison.hypervolume[places]
        numbers = (np.median(volumes), volumes.min(), volumes.max())
        rows.append([label, str(len(places)), *(f"{number:.4f}" for number in numbers)])
    return rows


def _pairs(names: list[str], values: np.ndarray) -> list[list[str]]:
    rows = [["", *names]]
    for i, name in enumerate(names):
        rows.append([name, *("–" if i == j else f"{value:.4f}" for j, value in enumerate(values[i]))])
    return rows


def _distinct(labels: tuple[str, ...]) -> list[str]:
    """Return labels that differ: those of one method are counted."""
    counted = [f"{label} {labels[: place + 1].count(label)}" for place, label in enumerate(labels)]
    return [number if labels.count(label) > 1 else label for number, label in zip(counted, labels, strict=True)]
