"""Names, units and senses of a problem's objectives."""

from __future__ import annotations

from typing import Any

from paretoik.errors import InvalidInput
from paretoik.front.names import check_names
from paretoik.inputs import check_flag, shown


def describe_objectives(problem: Any) -> tuple[tuple[str, ...], tuple[str, ...], tuple[bool, ...]]:
    """Return names, units and senses of a problem's objectives; f1, f2, ... minimised, for a plain pymoo problem.

    Raises InvalidInput for those that no front can have.
    """
    n_obj = problem.n_obj
    plain: dict[str, tuple[Any, ...]] = {
        "names": tuple(f"f{axis + 1}" for axis in range(n_obj)),
        "units": ("",) * n_obj,
        "maximised": (False,) * n_obj,
    }
    names, units, maximised = (_entries(problem, name) or entries for name, entries in plain.items())
    for name, values in zip(plain, (names, units, maximised), strict=True):
        if len(values) != n_obj:
            raise InvalidInput(f"problem.{name}: {n_obj} wanted, one an objective, got {len(values)}")
    check_names(names, units)
    for value in maximised:
        check_flag("problem.maximised", value)
    return names, units, maximised


def _entries(problem: Any, name: str) -> tuple[Any, ...]:
    """Return an attribute with an entry an objective, nothing if the problem has none."""
    given = getattr(problem, name, None)
    try:
        return () if given is None else tuple(given)
    except TypeError:
        raise InvalidInput(f"problem.{name} must have one entry an objective, got {shown(given)}") from None
