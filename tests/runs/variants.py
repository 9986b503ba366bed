"""Copies of a problem that differ from it in one number, word or truth value, at any place."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.runs.fingerprint import EVALUATION

OPAQUE = (type, type(len), type(lambda: None), Path)  # code, and where files are: other tests change these


def variants(value: Any, rng: np.random.Generator, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield copies of a value, each with one change, and its place; for an array one number changes."""
    if isinstance(value, OPAQUE):
        return
    if isinstance(value, bool | np.bool_):
        yield path, not value
    elif isinstance(value, int | float | np.number):
        yield path, (value + 1 if np.isfinite(value) else 1.0)
    elif isinstance(value, str):
        yield path, f"{value}x"
    elif value is None:
        yield path, 1.0
    elif isinstance(value, np.ndarray):
        yield from ((path, changed) for changed in _changed_arrays(value, rng))
    elif isinstance(value, tuple | list):
        yield path, [*value, 1.0]
        for k, each in enumerate(value):
            for place, changed in variants(each, rng, f"{path}[{k}]"):
                yield place, type(value)([*value[:k], changed, *value[k + 1 :]])
    elif isinstance(value, Mapping):
        yield path, {**value, "x": 1.0}
        for key, each in value.items():
            for place, changed in variants(each, rng, f"{path}[{key!r}]"):
                yield place, {**value, key: changed}
    else:
        for name in names(value):
            for place, changed in variants(getattr(value, name), rng, f"{path}.{name}"):
                other = copy.copy(value)
                object.__setattr__(other, name, changed)
                yield place, other


def names(value: Any) -> list[str]:
    """Return the names of an object's parts."""
    kind = type(value)
    if is_dataclass(kind):
        return [each.name for each in fields(kind)]
    lazy = {name for base in kind.__mro__ for name, item in vars(base).items() if isinstance(item, cached_property)}
    free = EVALUATION | lazy | set(getattr(kind, "search_attributes", ()))
    return [name for name in vars(value) if name not in free]


def _changed_arrays(array: np.ndarray, rng: np.random.Generator) -> Iterator[np.ndarray]:
    changed = array.copy()
    if not array.size:
        yield np.ones(3)
        return
    place = tuple(rng.integers(size) for size in array.shape)
    if array.dtype.kind == "b":
        changed[place] = not array[place]
    elif array.dtype.kind == "U":
        changed[place] = ""
    elif array.dtype.kind in "iu":
        changed[place] += 1
    else:
        changed[place] = array[place] + 0.37 if np.isfinite(array[place]) else 1.0
    yield changed
