"""Names, units and senses of a problem's objectives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from paretoik.errors import InvalidInput


def describe_objectives(problem: Any) -> tuple[tuple[str, ...], tuple[str, ...], tuple[bool, ...]]:
    """Return names, units and senses of a problem's objectives; f1, f2, ... minimised, for a plain pymoo problem."""
    n_obj = problem.n_obj
    names = tuple(getattr(problem, "names", None) or (f"f{axis + 1}" for axis in range(n_obj)))
    units = tuple(getattr(problem, "units", None) or ("",) * n_obj)
    maximised = tuple(getattr(problem, "maximised", None) or (False,) * n_obj)
    described: dict[str, Sequence[object]] = {"names": names, "units": units, "maximised": maximised}
    for name, values in described.items():
        if len(values) != n_obj:
            raise InvalidInput(f"problem.{name}: {n_obj} wanted, one an objective, got {len(values)}")
    return names, units, maximised
