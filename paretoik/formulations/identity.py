"""What a problem is made of, flat, for its fingerprint: equal parts mean equal problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def identity_parts(value: Any) -> list[object]:
    """Return arrays, numbers and names that make up dataclasses, sequences and functions."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = [part for each in fields(value) for part in (each.name, *identity_parts(getattr(value, each.name)))]
        return [type(value).__name__, *parts]
    if isinstance(value, Mapping):
        return [part for key, each in value.items() for part in (str(key), *identity_parts(each))]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [part for each in value for part in identity_parts(each)]
    if isinstance(value, np.ndarray | str | int | float | None):
        return [value]
    return [getattr(value, "__qualname__", type(value).__name__)]
