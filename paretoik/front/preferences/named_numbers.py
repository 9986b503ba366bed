"""Numbers by objective, as preferences take them: a mapping, keywords, or both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real
from types import MappingProxyType

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import check_mapping, shown


def named_numbers(
    kind: str,
    mapping: Mapping[str, float] | None,
    keywords: Mapping[str, float],
    *,
    accept: Callable[[float], bool] = np.isfinite,
    requirement: str = "a finite number",
) -> Mapping[str, float]:
    """Return numbers by objective, read-only; raises InvalidInput for what is none, and names that come twice."""
    if mapping is not None:
        check_mapping(kind, mapping, "numbers by objective", example="{'energy': 0.3}")
    merged = dict(mapping or {})
    twice = sorted(merged.keys() & keywords.keys())
    if twice:
        raise InvalidInput(f"{kind}: wanted each objective once, got {twice[0]} twice")
    merged.update(keywords)
    for name, value in merged.items():
        if not _is_number(value) or not accept(float(value)):
            raise InvalidInput(f"{kind}: wanted {requirement} for {name}, got {shown(value)}")
    return MappingProxyType({name: float(value) for name, value in merged.items()})


def named_text(numbers: Mapping[str, float]) -> str:
    """Return numbers by objective as they are written in Python."""
    identifiers = all(name.isidentifier() for name in numbers)
    return ", ".join(f"{name}={value:g}" for name, value in numbers.items()) if identifiers else str(dict(numbers))


def _is_number(value: object) -> bool:
    try:
        return not isinstance(value, bool) and isinstance(value, Real) and not np.isnan(float(value))
    except OverflowError:
        return False
