"""The Pareto front as named arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, Ids, Objectives, Values
from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.gaps import find_jumps, missing_hypervolume
from paretoik.front.indicators import non_dominated
from paretoik.front.joint_motions import JointMotions
from paretoik.front.names import check_names
from paretoik.front.navigation import choice_of, navigate, navigated, refine_around
from paretoik.inputs import file_path

Ranges: TypeAlias = Float[np.ndarray, "n_obj 2"]

MotionBuilder = Callable[[np.ndarray, np.ndarray, tuple[str, ...]], JointMotions]


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One point of a front: its ``id``, its row ``index``, its motion and objectives, and the reason of the choice."""

    id: int
    index: int
    objectives: Values
    reason: str
    motion: Any = None


@runtime_checkable
class Preference(Protocol):
    """A preference, which chooses one point of a front that has at least one."""

    def choose(self, front: Front) -> Choice:
        """Return the preferred point of `front`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Front:
    """Mutually non-dominated points, sorted by the first objective.

    Points may be handed in in any order; they are checked, sorted, copied and made read-only. An empty front is a
    result too: no feasible point.

    ``ids`` (points,) are unique and never reused; ``objectives`` (points, n_obj) stand in the user's own sign, with
    ``names``, ``units`` and ``maximised`` one an objective; ``genes`` (points, genes) and ``motions`` (a batch of
    points) may be missing; ``violation`` (points,) is the largest as a share of its limit's range; ``certificates``
    are those of refined points; ``ranges`` (n_obj, 2) are the lower and upper value that preferences
    measure against, by default those of the front itself; ``provenance`` describes the run (problem,
    settings, seed, status) and is stored in ``run.json``; ``problem`` is the problem itself, not stored.

    Raises InvalidInput for shapes that do not agree, values that are not finite, ids or names that repeat, names unfit
    for a table, and a point that another one dominates.
    """

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
    problem: Any = field(default=None, repr=False)

    def __post_init__(self) -> None:
        objectives = np.asarray(self.objectives, dtype=float)
        _check_objectives(self.names, self.units, self.maximised, objectives)
        ids = _check_ids(self.ids, len(objectives))
        order = np.lexsort((ids, *objectives.T[::-1]))
        assign = object.__setattr__
        assign(self, "names", tuple(self.names))
        assign(self, "units", tuple(self.units))
        assign(self, "maximised", tuple(bool(flag) for flag in self.maximised))
        assign(self, "ids", _read_only(ids[order]))
        assign(self, "objectives", _read_only(objectives[order]))
        assign(self, "genes", _sort_rows("genes", self.genes, order, dimensions=2))
        assign(self, "violation", _sort_rows("violation", self.violation, order, dimensions=1))
        assign(self, "motions", _sort_motions(self.motions, order))
        assign(self, "certificates", _sort_certificates(self.certificates, order))
        assign(self, "ranges", _check_ranges(self.ranges, objectives))
        assign(self, "provenance", MappingProxyType(dict(self.provenance)))
        _check_non_dominated(self)

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        """Return one line: how many points, between what values each objective lies, what further points could add."""
        points = "1 point" if len(self) == 1 else f"{len(self)} points"
        if len(self) == 0:
            return f"Front of {points}: {', '.join(self.names)}"
        ranges = (
            f"{name} {low:.4g} to {high:.4g} {unit}".rstrip() + (" (maximised)" if maximised else "")
            for name, unit, maximised, low, high in zip(
                self.names, self.units, self.maximised, self.objectives.min(0), self.objectives.max(0), strict=True
            )
        )
        missing = self.missing_hypervolume
        further = (
            "" if missing is None else f"; further points could add about {100 * missing:.2g} % of the hypervolume"
        )
        return f"Front of {points}: {', '.join(ranges)}{further}"

    @property
    def minimised(self) -> Objectives:
        """The objectives (points, n_obj) with those that are maximised negated, so that less is always better."""
        minimised: Objectives = np.where(self.maximised, -self.objectives, self.objectives)
        return minimised

    @property
    def shares(self) -> Objectives:
        """Where each point stands in the ranges (points, n_obj): 0 the best value, 1 the worst, 0 on a zero range.

        Marcos et al. (2012), Eq. 19, on the stored ranges.
        """
        low, high = self.ranges.T
        width = high - low
        distance = np.where(self.maximised, high - self.objectives, self.objectives - low)
        shares: Objectives = np.divide(distance, width, out=np.zeros_like(distance), where=width > 0)
        return shares

    @property
    def violation_between(self) -> Values | None:
        """Worst violation of each motion's limits between its samples, measured where there are no certificates.

        None where neither these nor a problem with motions are at hand.
        """
        if self.certificates is not None:
            return self.certificates.violation_between
        measure = getattr(getattr(self.problem, "task", None), "violation_between", None)
        return None if measure is None or self.motions is None else measure(self.motions)

    @cached_property
    def jumps(self) -> tuple[tuple[int, int], ...] | None:
        """Neighbours, as pairs of ids, between which the front jumps from one branch of optima to another.

        Halfway between the two lies a barrier: what is interpolated between them is worse than both in some objective,
        or impossible. Navigation from one to the other cannot be continuous there.

        None where this is not defined or not known: of other than two objectives, where points have no order, without
        certificates, or without a problem that can interpolate (the one that the front came from).
        """
        return find_jumps(self)

    @cached_property
    def missing_hypervolume(self) -> float | None:
        """Share of the hypervolume up to the front's worst values that further points could still add, 0 to 1.

        An estimate: between neighbours the front is taken for the parabola that touches the tangents of their exchange
        rates, or for the chord where these contradict each other or are unknown. None of other than two objectives,
        without certificates, and of fewer than two points.
        """
        return missing_hypervolume(self)

    def select(self, preference: Preference) -> Choice:
        """Return the point that `preference` chooses; a closed loop is followed again with it.

        Raises Infeasible where the front is empty.
        """
        if len(self) == 0:
            raise Infeasible("select: wanted a front of at least one point, got none: no point was feasible")
        if isinstance(preference, type) or not isinstance(preference, Preference):
            raise InvalidInput(f"select: a preference wanted, such as Weights(...), got {preference!r}")
        select: Callable[[Front, Preference], Choice] | None = getattr(self.problem, "select", None)
        return preference.choose(self) if select is None else select(self, preference)

    navigate = navigate
    refine_around = refine_around
    navigated = property(navigated)
    choice_of = choice_of

    def choice(self, index: int, reason: str) -> Choice:
        """Return the point of a row as a choice."""
        motion = None if self.motions is None else self.motions[index]
        return Choice(
            id=int(self.ids[index]), index=index, objectives=self.objectives[index], motion=motion, reason=reason
        )

    def quantity(self, axis: int, value: float) -> str:
        """Return a value of an objective with its name and unit."""
        return f"{self.names[axis]} {value:.4g} {self.units[axis]}".rstrip()

    def save(self, folder: Path | str) -> None:
        """Write `run.json`, `front.parquet` and, with genes or motions, `motions.npz` into `folder`."""
        from paretoik.front.storage import save

        save(self, file_path("folder", folder))

    @staticmethod
    def load(folder: Path | str, *, motions: MotionBuilder | None = None) -> Front:
        """Read a saved front; `motions` builds motions from the stored times, joint positions and joint names.

        Raises InvalidRun where a file is missing, damaged, a link, of another version, or of another run.
        """
        from paretoik.front.storage import load

        return load(file_path("folder", folder), build_motions=motions)


def _check_objectives(
    names: Sequence[str], units: Sequence[str], maximised: Sequence[bool], objectives: np.ndarray
) -> None:
    if objectives.ndim != 2 or objectives.shape[1] == 0:
        raise InvalidInput(f"front objectives: wanted an array (points, n_obj), got shape {objectives.shape}")
    if not np.isfinite(objectives).all():
        bad = int((~np.isfinite(objectives).all(axis=1)).sum())
        raise InvalidInput(f"front objectives: wanted finite numbers, got {bad} of {len(objectives)} points without")
    n_obj = objectives.shape[1]
    for field_name, values in (("names", names), ("units", units), ("maximised", maximised)):
        if isinstance(values, str) or len(values) != n_obj:
            raise InvalidInput(f"front {field_name}: wanted one for each of {n_obj} objectives, got {values!r}")
    check_names(names, units)


def _check_ids(values: np.ndarray, points: int) -> Ids:
    ids = np.asarray(values)
    if ids.size == 0:
        ids = ids.astype(np.int64)
    if ids.shape != (points,) or ids.dtype.kind not in "iu":
        raise InvalidInput(f"front ids: wanted {points} integers, got {ids.dtype} of shape {ids.shape}")
    unique, counts = np.unique(ids, return_counts=True)
    if len(unique) != points:
        raise InvalidInput(f"front ids: wanted each once, got {unique[counts > 1][0]} {counts.max()} times")
    if points and ids.min() < 0:
        raise InvalidInput(f"front ids: wanted integers >= 0, got {ids.min()}")
    return ids.astype(np.int64)


def _sort_rows(name: str, values: np.ndarray | None, order: np.ndarray, *, dimensions: int) -> np.ndarray | None:
    if values is None:
        return None
    rows = np.asarray(values, dtype=float)
    if rows.ndim != dimensions or len(rows) != len(order) or not np.isfinite(rows).all():
        raise InvalidInput(f"front {name}: wanted finite numbers for {len(order)} points, got shape {rows.shape}")
    return _read_only(rows[order])


def _sort_motions(motions: JointMotions | None, order: np.ndarray) -> Any:
    if motions is None:
        return None
    if np.ndim(motions.q) != 3 or len(motions) != len(order):
        raise InvalidInput(f"front motions: wanted a batch of {len(order)}, got joint positions {np.shape(motions.q)}")
    return motions if (order == np.arange(len(order))).all() else motions[order]


def _sort_certificates(certificates: Certificates | None, order: np.ndarray) -> Certificates | None:
    if certificates is None:
        return None
    if len(certificates) != len(order):
        raise InvalidInput(f"front certificates: wanted one for each of {len(order)} points, got {len(certificates)}")
    return certificates[order]


def _check_ranges(values: np.ndarray, objectives: Objectives) -> Ranges:
    n_obj = objectives.shape[1]
    ranges = np.array(values, dtype=float)
    if ranges.size == 0:
        empty = len(objectives) == 0
        ranges = np.zeros((n_obj, 2)) if empty else np.stack([objectives.min(axis=0), objectives.max(axis=0)], axis=1)
    if ranges.shape != (n_obj, 2) or not np.isfinite(ranges).all() or (ranges[:, 0] > ranges[:, 1]).any():
        raise InvalidInput(f"front ranges: wanted a finite (lower, upper) for each of {n_obj}, got {ranges.tolist()}")
    return _read_only(ranges)


def _check_non_dominated(front: Front) -> None:
    unique, first = np.unique(front.minimised, axis=0, return_index=True)
    dominated = first[~non_dominated(unique)]
    if dominated.size:
        raise InvalidInput(
            f"front: wanted mutually non-dominated points, got {dominated.size} dominated ones, "
            f"the first with id {front.ids[dominated.min()]}"
        )


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array
