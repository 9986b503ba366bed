"""Data of a front: checked, sorted, read-only parts, derived values, and subsets."""

# Annotations are not postponed: a subclass of a dataclass needs the types of the fields, not their text.

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes, Ids, Mask, Objectives, Values, read_only
from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.geometry import JUMPS, barriers, missing_hypervolume, supported
from paretoik.front.hypervolume import non_dominated, ranges_of
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
from paretoik.tables import represented

RESERVED_NAMES = ("id", "violation", "violation_between", "criticality", "kkt_residual", "status", "reason")


def check_names(names: Sequence[str], units: Sequence[str]) -> None:
    """Raise InvalidInput for names or units that do not fit a table, or names that repeat."""
    if len(set(names)) != len(names):
        raise InvalidInput(f"front names must name each objective once, got {list(names)}")
    for name in names:
        printable = isinstance(name, str) and name.isprintable() and name.strip() == name
        if not printable or name[:1] in ("", "=", "+", "-", "@"):  # a spreadsheet runs cells that begin so
            raise InvalidInput(
                f"front names must be printable, without outer spaces or a leading = + - @, got {shown(name)}"
            )
        if name in RESERVED_NAMES:
            raise InvalidInput(f"front names must not be any of {', '.join(RESERVED_NAMES)}, got {shown(name)}")
    for unit in units:
        if not isinstance(unit, str) or not unit.isprintable():
            raise InvalidInput(f"front units must be printable text, got {shown(unit)}")


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
    """Joint names of stored motions; their file has no other data of the arm."""

    joint_names: tuple[str, ...]


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class StoredMotions:
    """Motions as read from a run folder, without their arm."""

    arm: StoredJoints
    time: np.ndarray
    q: np.ndarray

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, index: Any, /) -> "StoredMotions":
        return StoredMotions(arm=self.arm, time=self.time[index], q=self.q[index])


# Provenance of fronts: entries by name.


NAVIGATIONS, LARGEST_ID = "navigations", "largest_id"  # entries: moves along the front; largest id of the whole front
ADDED_SAMPLES = "samples"  # entry: numbers of samples of the user's path, and of the motions if refinement added some
SOLVERS = "solvers"  # entry: solver that refined points, and number of points confirmed by a convex program
REFINED_BY = {"interior-point": "the interior-point method", "sqp": "SQP (cvxpy, Clarabel)"}


def confirmation(solver: str, confirmed: int, points: int) -> dict[str, dict[str, Any]]:
    """Return the provenance entry on the solver, and on the number of points confirmed as critical."""
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
            lines.append(f"on {used} samples: with the path's {given}, a value was over 0.1 % off its curve's")
    return "\n".join(lines)


# Checks of a front's parts, and their order.


Ranges: TypeAlias = Float[np.ndarray, "n_obj 2"]


def check_objectives(
    names: Sequence[str], units: Sequence[str], maximised: Sequence[bool], values: Objectives
) -> Objectives:
    """Return objectives (points, n_obj) as floats.

    Raises InvalidInput unless they are finite, and each has one name, one unit and one direction.
    """
    objectives = real_array("front objectives", values)
    if objectives.ndim != 2 or objectives.shape[1] == 0:
        raise InvalidInput(f"front objectives must be an array (points, n_obj), got shape {objectives.shape}")
    if not np.isfinite(objectives).all():
        bad = int((~np.isfinite(objectives).all(axis=1)).sum())
        raise InvalidInput(f"front objectives must be finite, got inf or nan in {bad} of {len(objectives)} points")
    n_obj = objectives.shape[1]
    for part, each, kind, wish in (
        ("names", names, str, "a list of names"),
        ("units", units, str, "a list of texts"),
        ("maximised", maximised, (bool, np.bool_), "a list of True or False"),
    ):
        if len(read_list(f"front {part}", each, kind, wish)) != n_obj:
            raise InvalidInput(f"front {part} must be one for each of {n_obj} objectives, got {shown(each)}")
    check_names(names, units)
    return objectives


def check_ids(values: np.ndarray, points: int) -> Ids:
    """Return ids as integers; raises InvalidInput unless there is one per point, unique and >= 0."""
    ids = integer_array("front ids", values)
    if ids.shape != (points,):
        raise InvalidInput(f"front ids must be {points} integers, got shape {ids.shape}")
    unique, counts = np.unique(ids, return_counts=True)
    if len(unique) != points:
        raise InvalidInput(f"front ids must be unique, got {unique[counts > 1][0]} more than once")
    if points and ids.min() < 0:
        raise InvalidInput(f"front ids must be integers >= 0, got {ids.min()}")
    return ids


def sort_part(name: str, part: Any, order: np.ndarray) -> Any:
    """Return an optional part of a front with its rows in ``order``; raises InvalidInput for an invalid part."""
    points = len(order)
    if part is None:
        return None
    if name == "certificates":
        check_instance("front certificates", part, Certificates, "those of refined points")
        if len(part) != points:
            raise InvalidInput(f"front certificates must be one for each of {points} points, got {len(part)}")
        return part[order]
    if name == "motions":
        q = getattr(part, "q", None)
        if not isinstance(q, np.ndarray):
            raise InvalidInput(f"front motions must be a batch of motions, got {shown(part)}")
        if q.ndim != 3 or len(part) != points:
            raise InvalidInput(f"front motions must be a batch of {points} motions, got q of shape {q.shape}")
        return part if (order == np.arange(points)).all() else part[order]
    rows = real_array(f"front {name}", part)
    if rows.ndim != {"genes": 2, "violation": 1}[name] or len(rows) != points or not np.isfinite(rows).all():
        fault = "" if np.isfinite(rows).all() else " with inf or nan"
        raise InvalidInput(f"front {name} must be finite, one row for each of {points}, got shape {rows.shape}{fault}")
    return read_only(rows[order])


def check_ranges(values: np.ndarray, objectives: Objectives) -> Ranges:
    """Return the ranges, by default those of the objectives; raises InvalidInput if they are invalid."""
    n_obj = objectives.shape[1]
    ranges = real_array("front ranges", values)
    if ranges.size == 0:
        empty = len(objectives) == 0
        ranges = np.zeros((n_obj, 2)) if empty else np.stack([objectives.min(axis=0), objectives.max(axis=0)], axis=1)
    if ranges.shape != (n_obj, 2) or not np.isfinite(ranges).all() or (ranges[:, 0] > ranges[:, 1]).any():
        raise InvalidInput(
            f"front ranges must be {n_obj} finite pairs (lower, upper), lower <= upper, got {shown(ranges.tolist())}"
        )
    with np.errstate(over="ignore"):
        wide = ~np.isfinite(np.ptp(ranges, axis=1))
    if wide.any():
        raise InvalidInput(
            f"front ranges must have upper − lower of at most {np.finfo(float).max:.3g}, got {ranges[wide][0].tolist()}"
        )
    return read_only(ranges)


PARTS = ("genes", "motions", "violation", "certificates")  # optional parts of a front
MotionBuilder = Callable[[np.ndarray, np.ndarray, tuple[str, ...]], JointMotions]
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FrontData:
    """Data of a front and derived values; ``front.Front`` describes the fields and adds methods."""

    ids: Ids
    objectives: Objectives
    names: Sequence[str]
    units: Sequence[str]
    maximised: Sequence[bool]
    genes: Genes | None = None
    motions: JointMotions | None = None
    violation: Values | None = None
    certificates: Certificates | None = None
    ranges: Ranges = field(default_factory=lambda: np.empty((0, 2)))
    provenance: Mapping[str, Any] = field(default_factory=dict)
    problem: Any = None
    folder: Path | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        objectives = check_objectives(self.names, self.units, self.maximised, self.objectives)
        ids = check_ids(self.ids, len(objectives))
        order = np.lexsort((ids, *objectives.T[::-1]))
        parts = {
            "names": tuple(self.names),
            "units": tuple(self.units),
            "maximised": tuple(bool(flag) for flag in self.maximised),
            "ids": read_only(ids[order]),
            "objectives": read_only(objectives[order]),
            **{name: sort_part(name, getattr(self, name), order) for name in PARTS},
            "ranges": check_ranges(self.ranges, objectives),
        }
        check_mapping("front provenance", self.provenance, "entries by name")
        parts["provenance"] = MappingProxyType(dict(self.provenance))
        for name, part in parts.items():
            object.__setattr__(self, name, part)
        unique, first = np.unique(self.minimised, axis=0, return_index=True)
        dominated = first[~non_dominated(unique)]
        if dominated.size:
            raise InvalidInput(
                f"front points must be mutually non-dominated, got {dominated.size} dominated ones, "
                f"the first with id {self.ids[dominated.min()]}"
            )

    def __len__(self) -> int:
        return len(self.ids)

    def __contains__(self, point: object) -> bool:
        """Return whether a point, given as id or choice, is on the front; never raises."""
        number, objectives = getattr(point, "id", point), getattr(point, "objectives", None)
        if not is_integer(number):
            return False
        (rows,) = np.nonzero(self.ids == int(number))
        return len(rows) == 1 and (objectives is None or np.array_equal(self.objectives[rows[0]], objectives))

    @property
    def minimised(self) -> Objectives:
        """Objectives (points, n_obj); maximised ones are negated, so that less is always better."""
        minimised: Objectives = np.where(self.maximised, -self.objectives, self.objectives)
        return minimised

    @cached_property
    def shares(self) -> Objectives:
        """Objectives as shares of the stored ranges (points, n_obj): 0 is best, 1 worst; 0 if a range is zero.

        Marcos et al. (2012), Eq. 19.
        """
        return read_only(shares_of(self, self.objectives))

    @cached_property
    def supported(self) -> Mask:
        """Mask of the points that have the least weighted sum of shares for some weights.

        The other points are above the convex hull by more than a millionth of the ranges: for any weights another point
        has a smaller sum.
        """
        return supported(self.shares)

    @property
    def violation_between(self) -> Values | None:
        """Worst violation of each motion's limits between its samples.

        It is that of the certificates. Without certificates it is measured; None if the front has no motions, or no
        problem that can measure it.
        """
        if self.certificates is not None:
            return self.certificates.violation_between
        measure = getattr(getattr(self.problem, "task", None), "violation_between", None)
        return None if measure is None or self.motions is None else measure(self.motions)

    @cached_property
    def jumps(self) -> tuple[tuple[int, int], ...] | None:
        """Pairs of neighbours (ids) between which the front jumps to another branch of optima.

        There is a barrier between the two: points interpolated there are worse than both in some objective, or
        impossible. A continuous move from one to the other is not possible.

        None unless the front has two objectives (only then do points have an order), certificates and a problem that
        can interpolate.
        """
        between = getattr(self.problem, "values_between", None)
        if len(self.names) != 2 or self.certificates is None or between is None:
            return None
        if len(self) < 2:
            return ()
        inner = between(self, np.arange(1, JUMPS.places + 1) / (JUMPS.places + 1))
        return tuple((int(self.ids[row]), int(self.ids[row + 1])) for row in barriers(self.minimised, inner))

    @cached_property
    def missing_hypervolume(self) -> float | None:
        """Estimated share of the hypervolume that further points could still add, 0 to 1.

        The reference point has the front's worst values. Between neighbours the front is approximated by the parabola
        that touches the tangents from their exchange rates, or by the chord if these contradict each other or are
        unknown. None unless there are two objectives, certificates and at least two points.
        """
        if len(self.names) != 2 or self.certificates is None or len(self) < 2:
            return None
        # The normals of the minimised front follow from the exchange rates, NaN if these are unreliable; if one
        # objective has no weight, the other has all.
        sign = np.prod(np.where(self.maximised, -1.0, 1.0))
        rates = sign * self.certificates.exchange_rates[:, 0, 1]
        normals = np.stack([-rates, np.ones(len(self))], axis=1)
        normals = np.where(self.certificates.weak[:, None], np.round(self.certificates.weights), normals)
        return missing_hypervolume(self.minimised, normals)


def shares_of(front: FrontData, values: Values) -> Values:
    """Return objectives (..., n_obj) as shares of the stored ranges: 0 is best; 0 if a range is zero."""
    low, high = front.ranges.T
    width = high - low
    distance = np.where(front.maximised, high - values, values - low)
    shares: Values = np.divide(distance, width, out=np.zeros_like(distance), where=width > 0)
    return shares


def widths_of(front: FrontData) -> Values:
    """Return the divisors (n_obj,) of objectives in a front's certificates: its ranges without zeros."""
    return ranges_of(front.ranges.T, np.abs(front.objectives).max(axis=0))


# Some points of a front: by their ids, or within bounds.


Bound: TypeAlias = tuple[float | None, float | None]


def check_front(front: object) -> None:
    """Raise InvalidInput unless this is a front of at least one point."""
    if not isinstance(front, FrontData) or len(front) == 0:
        raise InvalidInput(f"front must be a front of at least one point, got {shown(front)}")


def check_has_points(front: FrontData, verb: str) -> None:
    """Raise Infeasible if a front is empty; ``verb``: what was to be done with it."""
    if len(front) == 0:
        cause = "no point was feasible" if largest_id(front) < 0 else "this part of the front has no point"
        raise Infeasible(f"{verb}: the front must have at least one point, got none: {cause}")


def row_of(front: FrontData, number: object, *, name: str = "front") -> int:
    """Return the row of the point with an id; raises InvalidInput if there is no such point."""
    if not is_integer(number):
        raise InvalidInput(f"{name}: the id of a point must be an integer, got {shown(number)}")
    return int(rows_of(front, np.array([int(number)], dtype=object), name)[0])


def rows_of(front: FrontData, ids: np.ndarray, name: str) -> Int[np.ndarray, " rows"]:
    """Return the rows of the points with these ids; raises InvalidInput if the front does not have one."""
    rows = {number: row for row, number in enumerate(front.ids.tolist())}
    unknown = [number for number in ids.tolist() if number not in rows]
    if unknown:
        some = ", ".join(map(shown, unknown[:5])) + ", ..." * (len(unknown) > 5)
        extent = f"{len(front)} from {front.ids.min()} to {front.ids.max()}" if len(front) else "none"
        raise InvalidInput(f"{name}: ids must be those of the front's points ({extent}), got {some}")
    return np.array([rows[number] for number in ids.tolist()], dtype=np.int64)


def largest_id(front: FrontData) -> int:
    """Return the largest id that a front ever had; −1 if none.

    If the front is a part of another, the other's ids count too.
    """
    moves = (int(move["to"]) for move in front.provenance.get(NAVIGATIONS, ()))
    return max([int(front.ids.max(initial=-1)), int(front.provenance.get(LARGEST_ID, -1)), *moves])


Front = TypeVar("Front", bound=FrontData)  # the subclass ``front.Front`` in signatures that users see


def take(front: Front, rows: Int[np.ndarray, " rows"]) -> Front:
    """Return the front of some rows, with the same ranges and the same folder for choices.

    Its provenance has the largest id of the whole front, so that new points of the part get other ids.
    """
    largest = largest_id(front)
    note = {} if largest in front.ids[rows] else {LARGEST_ID: largest}
    whole = {name: getattr(front, name) for name in ("ids", "objectives", *PARTS)}
    parts: dict[str, Any] = {name: each if each is None else each[rows] for name, each in whole.items()}
    return attach(replace(front, **parts, provenance={**front.provenance, **note}), front.folder)


def attach(front: Front, folder: Any) -> Front:
    """Set the run folder in which a front's choices are kept, and return the same front."""
    object.__setattr__(front, "folder", folder)
    return front


def merge_named(
    kind: str, mapping: Mapping[str, T] | None, keywords: Mapping[str, T], members: str, example: str
) -> dict[str, T]:
    """Return the entries of a mapping and of keywords; raises InvalidInput for repeated names."""
    if mapping is not None:
        check_mapping(kind, mapping, f"{members} by objective", example=example)
    twice = sorted((mapping or {}).keys() & keywords.keys())
    if twice:
        raise InvalidInput(f"{kind} must have each objective once, got {twice[0]} twice")
    return {**(mapping or {}), **keywords}


def merge_bounds(name: str, bounds: Mapping[str, Bound] | None, named: Mapping[str, Bound]) -> dict[str, Bound]:
    """Return the bounds of objectives by name, checked as far as possible without a front."""
    merged = merge_named(name, bounds, named, "bounds", "{'energy': (None, 0.05)}")
    for each, pair in merged.items():
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise InvalidInput(f"{name} {each} must be (lower, upper), with None for an open side, got {shown(pair)}")
        lower, upper = (None if side is None else finite_number(f"{name} {each}", side) for side in pair)
        if lower is not None and upper is not None and lower > upper:
            raise InvalidInput(f"{name} {each} must have lower <= upper, got {shown(pair)}")
        merged[each] = lower, upper
    return merged


def bounds_by_axis(
    front: FrontData, bounds: Mapping[str, Bound], *, name: str = "bounds"
) -> Float[np.ndarray, "n_obj 2"]:
    """Return the lower and upper bound of every objective, infinite if open.

    Raises InvalidInput for a bound of an unknown objective.
    """
    check_known(front.names, name, bounds)
    limits = np.tile([-np.inf, np.inf], (len(front.names), 1))
    for objective, pair in bounds.items():
        for side, value in enumerate(pair):
            if value is not None:
                limits[front.names.index(objective), side] = value
    return limits


def inside(front: FrontData, limits: Float[np.ndarray, "n_obj 2"]) -> Mask:
    """Mark the points within the limits of every objective, limits included."""
    low, high = limits.T
    return np.asarray(((front.objectives >= low) & (front.objectives <= high)).all(axis=1))


def check_known(names: Sequence[str], label: str, given: Iterable[str]) -> None:
    """Raise InvalidInput, which lists the valid ``names``, if a given one is not among them."""
    for each in given:
        if each not in names:
            hint = likely_spelling(each, names)
            raise InvalidInput(f"{label} must have names among {', '.join(names)}, got {shown(each)}{hint}")
