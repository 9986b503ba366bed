"""Some points of a front: by their ids, or within bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Mask
from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.provenance import LARGEST_ID, NAVIGATIONS
from paretoik.inputs import check_mapping, finite_number, is_integer, likely_spelling, shown

if TYPE_CHECKING:  # a front asks this file for its parts
    from paretoik.front.front import Front

Bound: TypeAlias = tuple[float | None, float | None]


def check_front(front: object) -> None:
    """Raise InvalidInput unless this is a front of at least one point."""
    from paretoik.front.front import Front

    if not isinstance(front, Front) or len(front) == 0:
        raise InvalidInput(f"front: a front of at least one point wanted, got {shown(front)}")


def check_has_points(front: Front, verb: str) -> None:
    """Raise Infeasible, in the name of a verb, where a front is empty."""
    if len(front) == 0:
        cause = "no point was feasible" if largest_id(front) < 0 else "this part of the front has no point"
        raise Infeasible(f"{verb}: wanted a front of at least one point, got none: {cause}")


def row_of(front: Front, number: object, *, name: str = "front") -> int:
    """Return the row of the point with an id; raises InvalidInput where the front has none."""
    if not is_integer(number):
        raise InvalidInput(f"{name}: an id of a point wanted, got {shown(number)}")
    return int(_rows_of(front, np.array([int(number)], dtype=object), name)[0])


def has_point(front: Front, point: object) -> bool:
    """Say whether a front has a point, an id or a choice; raises nothing for what is none."""
    number, objectives = getattr(point, "id", point), getattr(point, "objectives", None)
    if not is_integer(number):
        return False
    (rows,) = np.nonzero(front.ids == int(number))
    return len(rows) == 1 and (objectives is None or np.array_equal(front.objectives[rows[0]], objectives))


def with_ids(front: Front, ids: Any) -> Front:
    """Return the front of the points with these ids, in their order on the front.

    Raises InvalidInput for ids that repeat or that the front does not have.
    """
    array = np.asarray(ids) if isinstance(ids, Sequence | np.ndarray) and not isinstance(ids, str) else np.empty((0, 0))
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InvalidInput(f"front: an id, or several, wanted, got {shown(ids)}")
    return take(front, _rows_of(front, array, "front"))


def largest_id(front: Front) -> int:
    """Return the largest id that a point of a front, or of one that it is a part of, ever had; −1 where none had."""
    moves = (int(move["to"]) for move in front.provenance.get(NAVIGATIONS, ()))
    return max([int(front.ids.max(initial=-1)), int(front.provenance.get(LARGEST_ID, -1)), *moves])


def take(front: Front, rows: Int[np.ndarray, " rows"]) -> Front:
    """Return the front of some rows: ranges as before, its choices kept in the same folder.

    Its provenance says what the largest id of the whole was, so that new points of the part get others.
    """
    largest = largest_id(front)
    note = {} if largest in front.ids[rows] else {LARGEST_ID: largest}
    part = replace(
        front,
        ids=front.ids[rows],
        objectives=front.objectives[rows],
        genes=None if front.genes is None else front.genes[rows],
        motions=None if front.motions is None else front.motions[rows],
        violation=None if front.violation is None else front.violation[rows],
        certificates=None if front.certificates is None else front.certificates[rows],
        provenance={**front.provenance, **note},
    )
    return attach(part, front.folder)


def attach(front: Front, folder: Any) -> Front:
    """Return a front, itself, as one whose choices a run folder keeps."""
    object.__setattr__(front, "folder", folder)
    return front


def within_bounds(front: Front, bounds: Mapping[str, Bound] | None, named: Mapping[str, Bound]) -> Front:
    """Return the front of the points within bounds, by objective; raises InvalidInput for others than pairs."""
    limits = bounds_by_axis(front, merge_bounds("where", bounds, named), name="where")
    return take(front, np.flatnonzero(inside(front, limits)))


def merge_bounds(
    name: str, bounds: Mapping[str, Bound] | None, named: Mapping[str, Bound]
) -> dict[str, tuple[float | None, float | None]]:
    """Return bounds by objective, checked as far as they can be without a front."""
    if bounds is not None:
        check_mapping(name, bounds, "bounds by objective", example="{'energy': (None, 0.05)}")
    merged, twice = {**(bounds or {}), **named}, sorted((bounds or {}).keys() & named.keys())
    if twice:
        raise InvalidInput(f"{name}: wanted each objective once, got {twice[0]} twice")
    return {each: _check_bound(f"{name} {each}", pair) for each, pair in merged.items()}


def bounds_by_axis(front: Front, bounds: Mapping[str, Bound], *, name: str = "bounds") -> Float[np.ndarray, "n_obj 2"]:
    """Return the lower and upper bound of every objective, infinite where open.

    Raises InvalidInput, by ``name``, where one is of no objective.
    """
    check_known(front, name, bounds)
    limits = np.tile([-np.inf, np.inf], (len(front.names), 1))
    for objective, pair in bounds.items():
        for side, value in enumerate(pair):
            if value is not None:
                limits[front.names.index(objective), side] = value
    return limits


def inside(front: Front, limits: Float[np.ndarray, "n_obj 2"]) -> Mask:
    """Mark the points within the limits of every objective, these included."""
    low, high = limits.T
    return np.asarray(((front.objectives >= low) & (front.objectives <= high)).all(axis=1))


def check_known(front: Front, name: str, objectives: Mapping[str, object] | Sequence[str]) -> None:
    """Raise InvalidInput, with the valid ones, where a name is none of the front's objectives."""
    unknown = [each for each in objectives if each not in front.names]
    if unknown:
        hint = likely_spelling(unknown[0], front.names)
        raise InvalidInput(f"{name}: wanted names among {', '.join(front.names)}, got {shown(unknown[0])}{hint}")


def _rows_of(front: Front, ids: np.ndarray, name: str) -> Int[np.ndarray, " rows"]:
    rows = {number: row for row, number in enumerate(front.ids.tolist())}
    unknown = [number for number in ids.tolist() if number not in rows]
    if unknown:
        some = ", ".join(map(shown, unknown[:5])) + ", ..." * (len(unknown) > 5)
        extent = f"{len(front)} from {front.ids.min()} to {front.ids.max()}" if len(front) else "none"
        raise InvalidInput(f"{name}: wanted ids of its points ({extent}), got {some}")
    return np.array([rows[number] for number in ids.tolist()], dtype=np.int64)


def _check_bound(name: str, pair: object) -> tuple[float | None, float | None]:
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise InvalidInput(f"{name}: wanted (lower, upper), None where open, got {shown(pair)}")
    lower, upper = (None if side is None else finite_number(name, side) for side in pair)
    if lower is not None and upper is not None and lower > upper:
        raise InvalidInput(f"{name}: wanted lower <= upper, got {shown(pair)}")
    return lower, upper
