"""Sizes of a recording's views in a viewer of 1600 by 900, whose text has a fixed size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import rerun as rr

from paretoik.review.drawing.axes import TEXT, text_width
from paretoik.review.palette import VIEWS
from tests.review.reading import opening_layout, read, static_values, static_words

TABS, HORIZONTAL, VERTICAL = 1, 2, 3


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """The letters of a label are ``height`` of a line tall in the viewer."""

    height: float = 0.9


LABELS = LabelOptions()


def label_halves(words: Sequence[str]) -> np.ndarray:
    """Return half the width and height (words, 2) [pixels] of labels as the viewer draws them, padding left out."""
    return 0.5 * np.array([(text_width(word), LABELS.height * TEXT.line) for word in words])


def view_scales(file: Path) -> dict[str, float]:
    """Return the pixels per unit of each flat view, by its origin, in the opening layout.

    The scale of a view in space is NaN, because it changes with the distance from the eye.
    """
    parts = layout_parts(file)
    (root,) = parts["viewport"]["ViewportBlueprint:root_container"]
    scales: dict[str, float] = {}
    _measure(parts, f"container/{UUID(bytes=bytes(root))}", np.array([VIEWS.width, VIEWS.body]), scales, titled=False)
    return scales


def _measure(parts: dict[str, dict[str, Any]], name: str, size: np.ndarray, scales: dict[str, float], titled: bool):
    """Add the scales of the views below a container of a `size`; ``titled``: it has a row of names."""
    part = parts[name]
    if "ViewBlueprint:space_origin" in part:
        bounds, origin = parts.get(f"{name}/VisualBounds2D"), "/" + part["ViewBlueprint:space_origin"][0].strip("/")
        if part["ViewBlueprint:class_identifier"] == ["3D"]:
            scales[origin] = float("nan")
        elif bounds is not None:
            (each,) = bounds["VisualBounds2D:range"]
            has_title = not titled and part.get("ViewBlueprint:display_name") != ["legend"]
            height = size[1] - VIEWS.title * has_title
            extent = np.array([np.ptp(each["x_range"]), np.ptp(each["y_range"])])
            scales[origin] = float((np.array([size[0], height]) / extent).min())
        return
    contents, (kind,) = part["ContainerBlueprint:contents"], part["ContainerBlueprint:container_kind"]
    if kind == TABS:
        for child in contents:
            _measure(parts, child, size - [0.0, VIEWS.title], scales, titled=True)
        return
    axis = {HORIZONTAL: 0, VERTICAL: 1}[kind]
    shares = np.array(part.get(f"ContainerBlueprint:{('col', 'row')[axis]}_shares") or [1.0] * len(contents))
    for child, share in zip(contents, shares / shares.sum(), strict=True):
        inner = size.copy()
        inner[axis] *= share
        _measure(parts, child, inner, scales, titled=False)


def tabs_of_charts(file: Path) -> dict[str, tuple[str, Any, int]]:
    """Return name, bounds and number of rows of tabs above of each flat view that is a tab in a column.

    The keys are their origins in the opening layout.
    """
    parts = layout_parts(file)
    parents = {
        child: parts[name] | {"name": name}
        for name, part in parts.items()
        for child in part.get("ContainerBlueprint:contents") or ()
    }
    tabs: dict[str, tuple[str, Any, int]] = {}
    for name, part in parts.items():
        rows, parent = 0, parents.get(name)
        while parent is not None and parent["ContainerBlueprint:container_kind"] == [TABS]:
            rows, parent = rows + 1, parents.get(parent["name"])
        if rows and f"{name}/VisualBounds2D" in parts:
            (bounds,) = parts[f"{name}/VisualBounds2D"]["VisualBounds2D:range"]
            origin = "/" + part["ViewBlueprint:space_origin"][0].strip("/")
            tabs[origin] = part["ViewBlueprint:display_name"][0], bounds, rows
    return tabs


def layout_parts(file: Path) -> dict[str, dict[str, Any]]:
    """Return the final components of each entity of the opening layout."""
    reader = rr.chunk.RrdReader(file)
    parts: dict[str, dict[str, Any]] = {}
    for chunk in reader.stream(store=reader.blueprints()[opening_layout(file)]):
        batch = chunk.to_record_batch()
        part = parts.setdefault(str(chunk.entity_path).strip("/"), {})
        for name in batch.schema.names:
            if ":" in name:
                part[name] = batch.column(name).to_pylist()[-1]
    return parts


def touching_words(
    file: Path, charts: Sequence[str], *, not_in_layout: Sequence[str] = ()
) -> list[tuple[str, str, str]]:
    """Return axes with pairs of their words, or the frame, that touch in the viewer.

    At or below each path of ``charts`` some flat axes must be measured. All other axes are also measured, except those
    in space and those at or below a path of ``not_in_layout``. Raises AssertionError otherwise.
    """
    entities, scales = read(file), view_scales(file)
    touching, measured = list[tuple[str, str, str]](), list[str]()
    for grid in sorted(path for path in entities if path.endswith("/grid")):
        axes = grid.removesuffix("/grid")
        scale = next((scales[origin] for origin in scales if _is_within(axes, origin)), None)
        assert (scale is None) == any(_is_within(axes, path) for path in not_in_layout), f"{axes}: views {list(scales)}"
        if scale is not None and not np.isnan(scale):
            measured.append(axes)
            assert f"{axes}/labels" in entities, f"{axes}: no labels"
            frame = scale * np.array(static_values(entities[grid], "strips")[-1])
            words = static_words(entities[f"{axes}/labels"])
            middles = scale * np.array(static_values(entities[f"{axes}/labels"], "positions")) + [0.0, TEXT.drop]
            touching += [(axes, *pair) for pair in _touching_pairs(frame, words, middles)]
    missing = [path for path in charts if not any(_is_within(axes, path) for axes in measured)]
    assert charts, "no axes measured: no place of a chart is named"
    assert not missing, f"no axes measured at {missing}, only {measured}"
    return touching


def _is_within(path: str, folder: str) -> bool:
    return path == folder or path.startswith(f"{folder}/")


def _touching_pairs(frame: np.ndarray, words: Sequence[str], middles: np.ndarray) -> list[tuple[str, str]]:
    """Return words that touch the frame, after "frame", and pairs of touching words; middles (words, 2) [pixels]."""
    halves = label_halves(words)
    around = halves + np.array([0.5 * TEXT.padding, 0.0])
    reach = np.minimum(frame.max(axis=0), middles + around) - np.maximum(frame.min(axis=0), middles - around)
    touching = [("frame", word) for word, inside in zip(words, reach.min(axis=1) > 0.0, strict=True) if inside]
    for i, k in combinations(range(len(words)), 2):
        if (np.abs(middles[i] - middles[k]) < halves[i] + halves[k]).all():
            touching.append((words[i], words[k]))
    return touching
