"""The parts of a front, checked, sorted and made read-only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Ids, Mask, Objectives, read_only
from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.indicators import non_dominated
from paretoik.inputs import (
    check_instance,
    check_mapping,
    finite_number,
    integer_array,
    is_integer,
    likely_spelling,
    read_list,
    real_array,
    shown,
)
from paretoik.tables import field_representation, html_representation

if TYPE_CHECKING:
    from paretoik.front.front import Front

# Names and units of objectives that fit a table.


RESERVED_NAMES = ("id", "violation", "violation_between", "criticality", "kkt_residual", "status")


def check_names(names: Sequence[str], units: Sequence[str]) -> None:
    """Raise InvalidInput for names or units that do not fit a table, or names that repeat."""
    if len(set(names)) != len(names):
        raise InvalidInput(f"front names must name each objective once, got {list(names)}")
    for name in names:
        printable = isinstance(name, str) and name.isprintable() and name.strip() == name
        if not printable or name[:1] in ("", "=", "+", "-", "@"):  # these make a spreadsheet run the cell
            raise InvalidInput(
                f"front names must be printable, without outer spaces or a leading = + - @, got {shown(name)}"
            )
        if name in RESERVED_NAMES:
            raise InvalidInput(f"front names must not be any of {', '.join(RESERVED_NAMES)}, got {shown(name)}")
    for unit in units:
        if not isinstance(unit, str) or not unit.isprintable():
            raise InvalidInput(f"front units must be printable text, got {shown(unit)}")


# The part of a motion that a front uses, so that it depends on no robot.


@runtime_checkable
class JointMotions(Protocol):
    """A batch of joint motions: ``time`` (points, time) in s, ``q`` (points, time, dof) in rad or m."""

    @property
    def arm(self) -> Any:
        """The arm that moves; its ``joint_names`` are those of the columns of q."""

    @property
    def time(self) -> np.ndarray:
        """Sample times."""

    @property
    def q(self) -> np.ndarray:
        """Joint positions."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: Any, /) -> Any: ...


@dataclass(frozen=True, kw_only=True)
class StoredJoints:
    """The joint names of a stored motion, the only part of the arm in its file."""

    joint_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredMotions:
    """Motions as read from a run folder, without their arm."""

    arm: StoredJoints
    time: np.ndarray
    q: np.ndarray

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, index: Any, /) -> StoredMotions:
        return StoredMotions(arm=self.arm, time=self.time[index], q=self.q[index])


# How fronts were made, as names and values.


NAVIGATIONS, LARGEST_ID = "navigations", "largest_id"  # entries: moves made; largest id of the whole front
COMPARED = ("problem", "fingerprint", "settings", "versions", "computed", "status")  # counts and seconds always differ


ADDED_SAMPLES = "samples"  # entry: samples of the user's path, and of the motions if refinement added some
SOLVERS = "solvers"  # entry: solver that refined points, and number confirmed by a convex program
REFINED_BY = {"interior-point": "the interior-point method", "sqp": "SQP (cvxpy, Clarabel)"}


def confirmation(solver: str, confirmed: int, points: int) -> dict[str, dict[str, Any]]:
    """Return the entry on the solver that refined points, and on points confirmed as critical."""
    by = {"refinement": solver, "criticality": "cvxpy, Clarabel"}
    return {SOLVERS: {**by, "confirmed": confirmed, "points": points}}


def confirmation_text(provenance: Mapping[str, Any]) -> str:
    """Return lines on refinement, confirmation and added samples; "" if nothing is known."""
    lines = list[str]()
    match provenance.get(SOLVERS):
        case {"refinement": solver, "confirmed": int(confirmed), "points": int(points)}:
            confirmed_by = "a convex subproblem, stated in cvxpy and solved by Clarabel"
            by = REFINED_BY.get(solver, solver)
            lines.append(f"refined by {by}; {confirmed} of {points} points confirmed as critical by {confirmed_by}")
    match provenance.get(ADDED_SAMPLES):
        case {"path": int(given), "used": int(used)}:
            lines.append(f"on {used} samples: the path's {given} left values more than 0.1 % off those of the curves")
    return "\n".join(lines)


def flatten(entries: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Return nested entries as text by name.

    >>> flatten({"settings": {"seed": 1, "refine": None}})
    {'settings.seed': '1', 'settings.refine': '–'}
    """
    flat: dict[str, str] = {}
    for name, value in entries.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = "–" if value is None or value == "" else str(value)
    return flat


def differences(provenances: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, ...]]:
    """Return the entries that differ, by name, with the value of each, "–" if it has none.

    Only problems, settings, versions, what computed a run and what ended it are compared.
    """
    flat = [flatten({name: each[name] for name in COMPARED if name in each}) for each in provenances]
    names = dict.fromkeys(name for each in flat for name in each)
    values = {name: tuple(each.get(name, "–") for each in flat) for name in names}
    return {name: each for name, each in values.items() if len(set(each)) > 1}


# Some points of a front: by their ids, or within bounds.


Bound: TypeAlias = tuple[float | None, float | None]


def check_front(front: object) -> None:
    """Raise InvalidInput unless this is a front of at least one point."""
    from paretoik.front.front import Front

    if not isinstance(front, Front) or len(front) == 0:
        raise InvalidInput(f"front must be a front of at least one point, got {shown(front)}")


def check_has_points(front: Front, verb: str) -> None:
    """Raise Infeasible, in the name of a verb, if a front is empty."""
    if len(front) == 0:
        cause = "no point was feasible" if largest_id(front) < 0 else "this part of the front has no point"
        raise Infeasible(f"{verb}: the front must have at least one point, got none: {cause}")


def row_of(front: Front, number: object, *, name: str = "front") -> int:
    """Return the row of the point with an id; raises InvalidInput if there is no such point."""
    if not is_integer(number):
        raise InvalidInput(f"{name}: the id of a point must be an integer, got {shown(number)}")
    return int(_rows_of(front, np.array([int(number)], dtype=object), name)[0])


def has_point(front: Front, point: object) -> bool:
    """Return whether a front has a point, given as id or choice; never raises."""
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
        raise InvalidInput(f"front: the index must be an id, or several, got {shown(ids)}")
    return take(front, _rows_of(front, array, "front"))


def largest_id(front: Front) -> int:
    """Return the largest id that a front, or the whole front of a part, ever had; −1 if none."""
    moves = (int(move["to"]) for move in front.provenance.get(NAVIGATIONS, ()))
    return max([int(front.ids.max(initial=-1)), int(front.provenance.get(LARGEST_ID, -1)), *moves])


def take(front: Front, rows: Int[np.ndarray, " rows"]) -> Front:
    """Return the front of some rows, with the same ranges and the same folder for choices.

    Its provenance has the largest id of the whole front, so that new points of the part get other ids.
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
    """Set the run folder that keeps a front's choices, and return the same front."""
    object.__setattr__(front, "folder", folder)
    return front


def within_bounds(front: Front, bounds: Mapping[str, Bound] | None, named: Mapping[str, Bound]) -> Front:
    """Return the front of the points within bounds, by objective; raises InvalidInput for other bounds."""
    limits = bounds_by_axis(front, merge_bounds("where", bounds, named), name="where")
    return take(front, np.flatnonzero(inside(front, limits)))


def merge_bounds(
    name: str, bounds: Mapping[str, Bound] | None, named: Mapping[str, Bound]
) -> dict[str, tuple[float | None, float | None]]:
    """Return bounds by objective, after all checks that need no front."""
    if bounds is not None:
        check_mapping(name, bounds, "bounds by objective", example="{'energy': (None, 0.05)}")
    merged, twice = {**(bounds or {}), **named}, sorted((bounds or {}).keys() & named.keys())
    if twice:
        raise InvalidInput(f"{name} must have each objective once, got {twice[0]} twice")
    return {each: _check_bound(f"{name} {each}", pair) for each, pair in merged.items()}


def bounds_by_axis(front: Front, bounds: Mapping[str, Bound], *, name: str = "bounds") -> Float[np.ndarray, "n_obj 2"]:
    """Return the lower and upper bound of every objective, infinite if open.

    Raises InvalidInput, by ``name``, for a bound of an unknown objective.
    """
    check_known(front, name, bounds)
    limits = np.tile([-np.inf, np.inf], (len(front.names), 1))
    for objective, pair in bounds.items():
        for side, value in enumerate(pair):
            if value is not None:
                limits[front.names.index(objective), side] = value
    return limits


def inside(front: Front, limits: Float[np.ndarray, "n_obj 2"]) -> Mask:
    """Mark the points within the limits of every objective, or at these."""
    low, high = limits.T
    return np.asarray(((front.objectives >= low) & (front.objectives <= high)).all(axis=1))


def check_known(front: Front, name: str, objectives: Mapping[str, object] | Sequence[str]) -> None:
    """Raise InvalidInput, with the valid names, if a name is no objective of the front."""
    unknown = [each for each in objectives if each not in front.names]
    if unknown:
        hint = likely_spelling(unknown[0], front.names)
        raise InvalidInput(f"{name} must have names among {', '.join(front.names)}, got {shown(unknown[0])}{hint}")


def _rows_of(front: Front, ids: np.ndarray, name: str) -> Int[np.ndarray, " rows"]:
    rows = {number: row for row, number in enumerate(front.ids.tolist())}
    unknown = [number for number in ids.tolist() if number not in rows]
    if unknown:
        some = ", ".join(map(shown, unknown[:5])) + ", ..." * (len(unknown) > 5)
        extent = f"{len(front)} from {front.ids.min()} to {front.ids.max()}" if len(front) else "none"
        raise InvalidInput(f"{name}: ids must be those of the front's points ({extent}), got {some}")
    return np.array([rows[number] for number in ids.tolist()], dtype=np.int64)


def _check_bound(name: str, pair: object) -> tuple[float | None, float | None]:
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise InvalidInput(f"{name} must be (lower, upper), with None for an open side, got {shown(pair)}")
    lower, upper = (None if side is None else finite_number(name, side) for side in pair)
    if lower is not None and upper is not None and lower > upper:
        raise InvalidInput(f"{name} must have lower <= upper, got {shown(pair)}")
    return lower, upper


# Checks of a front's parts, and their order.


Ranges: TypeAlias = Float[np.ndarray, "n_obj 2"]

_BOOLEANS = (bool, np.bool_)
_WISHES = {"names": "a list of names", "units": "a list of texts", "maximised": "a list of True or False"}


def check_objectives(
    names: Sequence[str], units: Sequence[str], maximised: Sequence[bool], values: Objectives
) -> Objectives:
    """Return objectives as floats; raises InvalidInput unless names, units and directions agree."""
    objectives = real_array("front objectives", values)
    if objectives.ndim != 2 or objectives.shape[1] == 0:
        raise InvalidInput(f"front objectives must be an array (points, n_obj), got shape {objectives.shape}")
    if not np.isfinite(objectives).all():
        bad = int((~np.isfinite(objectives).all(axis=1)).sum())
        raise InvalidInput(f"front objectives must be finite numbers, got {bad} of {len(objectives)} points without")
    n_obj = objectives.shape[1]
    for field_name, each, kind in (("names", names, str), ("units", units, str), ("maximised", maximised, _BOOLEANS)):
        members = read_list(f"front {field_name}", each, kind, _WISHES[field_name])
        if len(members) != n_obj:
            raise InvalidInput(f"front {field_name} must be one for each of {n_obj} objectives, got {shown(each)}")
    check_names(names, units)
    return objectives


def check_ids(values: np.ndarray, points: int) -> Ids:
    """Return ids as integers; raises InvalidInput unless there is one per point, unique and >= 0."""
    ids = integer_array("front ids", values)
    if ids.shape != (points,):
        raise InvalidInput(f"front ids must be {points} integers, got shape {ids.shape}")
    unique, counts = np.unique(ids, return_counts=True)
    if len(unique) != points:
        raise InvalidInput(f"front ids must be unique, got {unique[counts > 1][0]} {counts.max()} times")
    if points and ids.min() < 0:
        raise InvalidInput(f"front ids must be integers >= 0, got {ids.min()}")
    return ids


def sort_rows(name: str, values: np.ndarray | None, order: np.ndarray, *, dimensions: int) -> np.ndarray | None:
    """Return values, one row per point, in an order; raises InvalidInput if they do not fit."""
    if values is None:
        return None
    rows = real_array(f"front {name}", values)
    if rows.ndim != dimensions or len(rows) != len(order) or not np.isfinite(rows).all():
        raise InvalidInput(f"front {name} must be finite numbers for {len(order)} points, got shape {rows.shape}")
    return read_only(rows[order])


def sort_motions(motions: JointMotions | None, order: np.ndarray) -> Any:
    """Return motions in an order; raises InvalidInput unless there is one per point."""
    if motions is None:
        return None
    q = getattr(motions, "q", None)
    if not isinstance(q, np.ndarray):
        raise InvalidInput(f"front motions must be a batch of motions, got {shown(motions)}")
    if q.ndim != 3 or len(motions) != len(order):
        raise InvalidInput(f"front motions must be a batch of {len(order)}, got joint positions {q.shape}")
    return motions if (order == np.arange(len(order))).all() else motions[order]


def sort_certificates(certificates: Certificates | None, order: np.ndarray) -> Certificates | None:
    """Return certificates in an order; raises InvalidInput unless there is one per point."""
    if certificates is None:
        return None
    check_instance("front certificates", certificates, Certificates, "those of refined points")
    if len(certificates) != len(order):
        raise InvalidInput(f"front certificates must be one for each of {len(order)} points, got {len(certificates)}")
    return certificates[order]


def check_ranges(values: np.ndarray, objectives: Objectives) -> Ranges:
    """Return the ranges, by default those of the objectives; raises InvalidInput for invalid ones."""
    n_obj = objectives.shape[1]
    ranges = real_array("front ranges", values)
    if ranges.size == 0:
        empty = len(objectives) == 0
        ranges = np.zeros((n_obj, 2)) if empty else np.stack([objectives.min(axis=0), objectives.max(axis=0)], axis=1)
    if ranges.shape != (n_obj, 2) or not np.isfinite(ranges).all() or (ranges[:, 0] > ranges[:, 1]).any():
        raise InvalidInput(
            f"front ranges must be a finite (lower, upper) for each of {n_obj}, got {shown(ranges.tolist())}"
        )
    with np.errstate(over="ignore"):
        wide = ~np.isfinite(np.ptp(ranges, axis=1))
    if wide.any():
        raise InvalidInput(
            f"front ranges must have upper − lower of at most {np.finfo(float).max:.3g}, got {ranges[wide][0].tolist()}"
        )
    return read_only(ranges)


def check_non_dominated(front: Front) -> None:
    """Raise InvalidInput if a point of a front dominates another."""
    unique, first = np.unique(front.minimised, axis=0, return_index=True)
    dominated = first[~non_dominated(unique)]
    if dominated.size:
        raise InvalidInput(
            f"front points must be mutually non-dominated, got {dominated.size} dominated ones, "
            f"the first with id {front.ids[dominated.min()]}"
        )
