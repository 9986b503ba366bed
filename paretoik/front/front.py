"""The Pareto front as named arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from paretoik.arrays import Genes, Ids, Objectives, Values, read_only
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.choice import Choice, Preference, check_preference
from paretoik.front.front_arguments import (
    Ranges,
    check_ids,
    check_non_dominated,
    check_objectives,
    check_ranges,
    sort_certificates,
    sort_motions,
    sort_rows,
)
from paretoik.front.gaps import find_jumps, missing_hypervolume
from paretoik.front.joint_motions import JointMotions
from paretoik.front.navigation import navigate, navigated, predict, refine_around, verdict_on
from paretoik.front.reason import explain
from paretoik.front.selection import select, undo
from paretoik.front.subset import Bound, has_point, row_of, with_ids, within_bounds
from paretoik.front.supported import supported
from paretoik.front.viewing import view
from paretoik.inputs import (
    check_flag,
    check_function,
    check_mapping,
    check_text,
    file_path,
    finite_number,
    is_integer,
    real_number,
    shown,
)
from paretoik.tables import fit_screen, html_representation

if TYPE_CHECKING:  # files and preferences are opened when they are used
    from paretoik.front.choices import Choices

__all__ = ["Choice", "Front", "Preference"]

MotionBuilder = Callable[[np.ndarray, np.ndarray, tuple[str, ...]], JointMotions]


@check_call
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
    settings, seed, status) and is stored in ``run.json``; ``problem`` is the problem itself, not stored. ``folder`` is
    the run folder that the front was loaded from or saved into last, where ``select`` keeps its choices, else None.

    ``len(front)`` is the number of points, ``front[12]`` the point with that id as a ``Choice``, ``12 in front`` says
    whether there is one, ``front[[12, 30]]`` is the front of some, and iterating yields every point as a ``Choice``.

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
    folder: Path | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        objectives = check_objectives(self.names, self.units, self.maximised, self.objectives)
        ids = check_ids(self.ids, len(objectives))
        order = np.lexsort((ids, *objectives.T[::-1]))
        assign = object.__setattr__
        assign(self, "names", tuple(self.names))
        assign(self, "units", tuple(self.units))
        assign(self, "maximised", tuple(bool(flag) for flag in self.maximised))
        assign(self, "ids", read_only(ids[order]))
        assign(self, "objectives", read_only(objectives[order]))
        assign(self, "genes", sort_rows("genes", self.genes, order, dimensions=2))
        assign(self, "violation", sort_rows("violation", self.violation, order, dimensions=1))
        assign(self, "motions", sort_motions(self.motions, order))
        assign(self, "certificates", sort_certificates(self.certificates, order))
        assign(self, "ranges", check_ranges(self.ranges, objectives))
        check_mapping("front provenance", self.provenance, "entries by name")
        assign(self, "provenance", MappingProxyType(dict(self.provenance)))
        check_non_dominated(self)

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        """Return how many points, between what values each objective lies, what further points could add."""
        points = "1 point" if len(self) == 1 else f"{len(self)} points"
        if len(self) == 0:
            return fit_screen(f"Front of {points}: {', '.join(self.names)}")
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
        return fit_screen(f"Front of {points}: {', '.join(ranges)}{further}")

    _repr_html_ = html_representation

    @property
    def minimised(self) -> Objectives:
        """The objectives (points, n_obj) with those that are maximised negated, so that less is always better."""
        minimised: Objectives = np.where(self.maximised, -self.objectives, self.objectives)
        return minimised

    @cached_property
    def shares(self) -> Objectives:
        """Where each point stands in the ranges (points, n_obj): 0 the best value, 1 the worst, 0 on a zero range.

        Marcos et al. (2012), Eq. 19, on the stored ranges.
        """
        low, high = self.ranges.T
        width = high - low
        distance = np.where(self.maximised, high - self.objectives, self.objectives - low)
        shares: Objectives = np.divide(distance, width, out=np.zeros_like(distance), where=width > 0)
        return read_only(shares)

    supported = cached_property(supported)

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

    @overload
    def __getitem__(self, ids: int) -> Choice: ...

    @overload
    def __getitem__(self, ids: Sequence[int] | np.ndarray) -> Front: ...

    def __getitem__(self, ids: Any) -> Choice | Front:
        """Return the point with an id as a choice, or the points with some ids as a front of the same ranges.

        Raises InvalidInput for ids that the front does not have.
        """
        if not isinstance(ids, Integral):
            return with_ids(self, ids)
        row = row_of(self, ids)
        return self.choice(row, verdict_on(self, row))

    def __contains__(self, point: object) -> bool:
        """Say whether a point, an id or a choice, is on the front."""
        return has_point(self, point)

    def __iter__(self) -> Iterator[Choice]:
        return (self.choice(row, verdict_on(self, row)) for row in range(len(self)))

    def where(self, bounds: Mapping[str, Bound] | None = None, /, **named: Bound) -> Front:
        """Return the front of the points within bounds, ``front.where(kinetic_energy=(None, 0.05))``.

        A bound is (lower, upper) in the objective's own units and sign, None where it is open; a mapping serves where a
        name is no identifier. Ranges, ids, motions, genes and certificates are kept. The front may be empty.

        Raises InvalidInput for other names and bounds.
        """
        return within_bounds(self, bounds, named)

    select = select
    undo = undo
    navigate = navigate
    predict = predict
    refine_around = refine_around
    navigated = property(navigated)
    view = view

    @property
    def choices(self) -> Choices:
        """The choices kept in the front's run folder, a tree; none without a folder.

        Raises InvalidRun where the file is damaged.
        """
        from paretoik.front.choices import Choices, read_choices

        return Choices() if self.folder is None else read_choices(self.folder)

    def choice(
        self,
        index: int,
        verdict: str,
        *,
        preference: Preference | None = None,
        score: float | None = None,
        details: Mapping[str, Any] | None = None,
    ) -> Choice:
        """Return the point of a row as a choice: a verdict on it, followed by what it gives up for what.

        Raises InvalidInput where the front has no such row.
        """
        self._check_index("index", index, len(self), "a row")
        check_text("verdict", verdict)
        check_preference("preference", preference)
        if score is not None:
            finite_number("score", score)
        if details is not None:
            check_mapping("details", details, "numbers by name")
        return explain(self, int(index), verdict, preference=preference, score=score, details=details or {})

    def quantity(self, axis: int, value: float) -> str:
        """Return a value of an objective with its name and unit; raises InvalidInput for what is none."""
        self._check_index("axis", axis, len(self.names), "an objective")
        value = real_number("value", value)
        return f"{self.names[axis]} {value:.4g} {self.units[axis]}".rstrip()

    def _check_index(self, name: str, index: object, count: int, wish: str) -> None:
        if not is_integer(index) or not 0 <= int(index) < count:
            raise InvalidInput(f"{name}: {wish} of {count} wanted, from 0 on, got {shown(index)}")

    def save(self, folder: Path | str, *, overwrite: bool = False) -> None:
        """Write `run.json`, `front.parquet` and, with genes or motions, `motions.npz` into `folder`.

        Raises InvalidInput where it holds another run, or points that this front has not, unless ``overwrite`` is set.
        """
        from paretoik.front.storage import save

        check_flag("overwrite", overwrite)
        save(self, file_path("folder", folder), overwrite=overwrite)

    @staticmethod
    def load(folder: Path | str, *, motions: MotionBuilder | None = None) -> Front:
        """Read a saved front; `motions` builds motions from the stored times, joint positions and joint names.

        Raises InvalidRun where a file is missing, damaged, a link, of another version, or of another run.
        """
        from paretoik.front.storage import load

        check_function("motions", motions)
        return load(file_path("folder", folder), build_motions=motions)
