"""What a front is made of, checked, sorted and made read-only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, read_only
from paretoik.errors import InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.indicators import non_dominated
from paretoik.front.joint_motions import JointMotions
from paretoik.front.names import check_names
from paretoik.inputs import check_instance, integer_array, read_list, real_array, shown

if TYPE_CHECKING:  # a front has itself checked here
    from paretoik.front.front import Front

Ranges: TypeAlias = Float[np.ndarray, "n_obj 2"]

_BOOLEANS = (bool, np.bool_)
_WISHES = {"names": "a list of names", "units": "a list of texts", "maximised": "a list of True or False"}


def check_objectives(
    names: Sequence[str], units: Sequence[str], maximised: Sequence[bool], values: Objectives
) -> Objectives:
    """Return objectives as floats; raises InvalidInput where their names, units and directions do not agree."""
    objectives = real_array("front objectives", values)
    if objectives.ndim != 2 or objectives.shape[1] == 0:
        raise InvalidInput(f"front objectives: wanted an array (points, n_obj), got shape {objectives.shape}")
    if not np.isfinite(objectives).all():
        bad = int((~np.isfinite(objectives).all(axis=1)).sum())
        raise InvalidInput(f"front objectives: wanted finite numbers, got {bad} of {len(objectives)} points without")
    n_obj = objectives.shape[1]
    for field_name, each, kind in (("names", names, str), ("units", units, str), ("maximised", maximised, _BOOLEANS)):
        members = read_list(f"front {field_name}", each, kind, _WISHES[field_name])
        if len(members) != n_obj:
            raise InvalidInput(f"front {field_name}: wanted one for each of {n_obj} objectives, got {shown(each)}")
    check_names(names, units)
    return objectives


def check_ids(values: np.ndarray, points: int) -> Ids:
    """Return ids as integers; raises InvalidInput where they are not one a point, unique and at least 0."""
    ids = integer_array("front ids", values)
    if ids.shape != (points,):
        raise InvalidInput(f"front ids: wanted {points} integers, got shape {ids.shape}")
    unique, counts = np.unique(ids, return_counts=True)
    if len(unique) != points:
        raise InvalidInput(f"front ids: wanted each once, got {unique[counts > 1][0]} {counts.max()} times")
    if points and ids.min() < 0:
        raise InvalidInput(f"front ids: wanted integers >= 0, got {ids.min()}")
    return ids


def sort_rows(name: str, values: np.ndarray | None, order: np.ndarray, *, dimensions: int) -> np.ndarray | None:
    """Return values, one row a point, in an order; raises InvalidInput where they do not fit."""
    if values is None:
        return None
    rows = real_array(f"front {name}", values)
    if rows.ndim != dimensions or len(rows) != len(order) or not np.isfinite(rows).all():
        raise InvalidInput(f"front {name}: wanted finite numbers for {len(order)} points, got shape {rows.shape}")
    return read_only(rows[order])


def sort_motions(motions: JointMotions | None, order: np.ndarray) -> Any:
    """Return motions in an order; raises InvalidInput where they are not one a point."""
    if motions is None:
        return None
    q = getattr(motions, "q", None)
    if not isinstance(q, np.ndarray):
        raise InvalidInput(f"front motions: a batch of motions wanted, got {shown(motions)}")
    if q.ndim != 3 or len(motions) != len(order):
        raise InvalidInput(f"front motions: wanted a batch of {len(order)}, got joint positions {q.shape}")
    return motions if (order == np.arange(len(order))).all() else motions[order]


def sort_certificates(certificates: Certificates | None, order: np.ndarray) -> Certificates | None:
    """Return certificates in an order; raises InvalidInput where they are not one a point."""
    if certificates is None:
        return None
    check_instance("front certificates", certificates, Certificates, "those of refined points")
    if len(certificates) != len(order):
        raise InvalidInput(f"front certificates: wanted one for each of {len(order)} points, got {len(certificates)}")
    return certificates[order]


def check_ranges(values: np.ndarray, objectives: Objectives) -> Ranges:
    """Return the ranges, those of the objectives where none are given; raises InvalidInput for others."""
    n_obj = objectives.shape[1]
    ranges = real_array("front ranges", values)
    if ranges.size == 0:
        empty = len(objectives) == 0
        ranges = np.zeros((n_obj, 2)) if empty else np.stack([objectives.min(axis=0), objectives.max(axis=0)], axis=1)
    if ranges.shape != (n_obj, 2) or not np.isfinite(ranges).all() or (ranges[:, 0] > ranges[:, 1]).any():
        raise InvalidInput(
            f"front ranges: wanted a finite (lower, upper) for each of {n_obj}, got {shown(ranges.tolist())}"
        )
    with np.errstate(over="ignore"):
        wide = ~np.isfinite(np.ptp(ranges, axis=1))
    if wide.any():
        raise InvalidInput(
            f"front ranges: wanted upper − lower of at most {np.finfo(float).max:.3g}, got {ranges[wide][0].tolist()}"
        )
    return read_only(ranges)


def check_non_dominated(front: Front) -> None:
    """Raise InvalidInput where a point of a front dominates another."""
    unique, first = np.unique(front.minimised, axis=0, return_index=True)
    dominated = first[~non_dominated(unique)]
    if dominated.size:
        raise InvalidInput(
            f"front: wanted mutually non-dominated points, got {dominated.size} dominated ones, "
            f"the first with id {front.ids[dominated.min()]}"
        )
