"""Constraint violations; names, units and senses of a problem's objectives."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from paretoik.errors import InvalidInput
from paretoik.front.points import check_names
from paretoik.inputs import check_flag, real_array, shown

# Violation of constraints.


Floats: TypeAlias = Float[np.ndarray, "..."]  # the docstring gives the shape
Integers: TypeAlias = Int[np.ndarray, "..."]

TOLERANCE = 1e-9
EQUALITY_TOLERANCE = 1e-4


def violations(
    F: Floats,
    G: Floats | None = None,
    H: Floats | None = None,
    *,
    tolerance: ArrayLike = TOLERANCE,
    equality_tolerance: ArrayLike = EQUALITY_TOLERANCE,
) -> Floats:
    """Return each point's sum of constraint excesses: 0 if it is feasible, inf if it failed.

    F: objectives (points, n_obj); the point failed if one is not finite
    G: inequality constraints (points, n_ieq), G <= 0, divided by each limit's range; the point failed if one is NaN
    H: equality constraints (points, n_eq), H = 0; the point failed if one is NaN
    tolerance: largest G that counts as 0, one number or one per column; a larger one counts in full
    equality_tolerance: largest |H| that counts as 0, one number or one per column; a larger one counts in full
    """
    total = np.zeros(len(F))
    with np.errstate(invalid="ignore"):
        if G is not None and G.shape[1]:
            slack = column_tolerance("tolerance", tolerance, G.shape[1])
            total += np.where(slack < G, G, 0.0).sum(axis=1)
            total[np.isnan(G).any(axis=1)] = np.inf
        if H is not None and H.shape[1]:
            excess = np.abs(H)
            slack = column_tolerance("equality_tolerance", equality_tolerance, H.shape[1])
            total += np.where(excess > slack, excess, 0.0).sum(axis=1)
            total[np.isnan(H).any(axis=1)] = np.inf
    total[~np.isfinite(F).all(axis=1)] = np.inf
    return total


def check_tolerance(name: str, tolerance: object) -> Floats:
    """Return a tolerance, one or one per constraint, as floats. Raises InvalidInput for a negative one or NaN."""
    values = real_array(name, tolerance)
    if values.ndim > 1 or not (values >= 0).all():
        raise InvalidInput(f"{name} must be numbers >= 0, got {shown(values.tolist())}")
    return values


def column_tolerance(name: str, tolerance: ArrayLike, columns: int) -> Floats:
    """Return one tolerance per constraint. Raises InvalidInput for a wrong count, a negative one or NaN."""
    values = check_tolerance(name, tolerance)
    if values.shape not in ((), (columns,)):
        raise InvalidInput(f"{name} must be one number or one per constraint ({columns}), got shape {values.shape}")
    return np.broadcast_to(values, (columns,))


# Names, units and senses of objectives.


def describe_objectives(problem: Any) -> tuple[tuple[str, ...], tuple[str, ...], tuple[bool, ...]]:
    """Return names, units and senses of a problem's objectives; by default f1, f2, ..., minimised.

    Raises InvalidInput for entries that a front cannot have.
    """
    n_obj, described = problem.n_obj, dict[str, tuple[Any, ...]]()
    plain: dict[str, tuple[Any, ...]] = {
        "names": tuple(f"f{axis + 1}" for axis in range(n_obj)),
        "units": ("",) * n_obj,
        "maximised": (False,) * n_obj,
    }
    for name, entries in plain.items():
        given = getattr(problem, name, None)
        try:
            described[name] = (() if given is None else tuple(given)) or entries
        except TypeError:
            raise InvalidInput(f"problem.{name} must have one entry per objective, got {shown(given)}") from None
    for name, values in described.items():
        if len(values) != n_obj:
            raise InvalidInput(f"problem.{name} must have one entry per objective ({n_obj}), got {len(values)}")
    names, units, maximised = described.values()
    check_names(names, units)
    for value in maximised:
        check_flag("problem.maximised", value)
    return names, units, maximised
