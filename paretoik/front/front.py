"""The Pareto front as named arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from numbers import Integral
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from paretoik.arrays import Genes, Ids, Objectives, Values, read_only
from paretoik.errors import InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.front.choice import Choice, Preference, check_preference, explain
from paretoik.front.geometry import find_jumps, missing_hypervolume, supported
from paretoik.front.navigation import navigate, navigated, predict, refine_around, verdict_on
from paretoik.front.points import (
    Bound,
    JointMotions,
    Ranges,
    check_has_points,
    check_ids,
    check_non_dominated,
    check_objectives,
    check_ranges,
    has_point,
    row_of,
    sort_certificates,
    sort_motions,
    sort_rows,
    with_ids,
    within_bounds,
)
from paretoik.inputs import (
    check_call,
    check_flag,
    check_function,
    check_mapping,
    check_size,
    check_text,
    file_path,
    finite_number,
    is_integer,
    real_number,
    shown,
)
from paretoik.runs.files import RECORDING
from paretoik.tables import fit_screen, html_representation

if TYPE_CHECKING:
    from paretoik.front.choice_tree import Choices

# A front in a notebook: the Rerun viewer below a cell, and what is selected in it as ids.


# By name, as this package knows nothing of those that draw.
OPENED_BY = "paretoik.review.drawing.front_view:open_view"
RECORDED_BY = "paretoik.review.drawing.choice_layer:show_choice_in_recording"


def view(
    front: Front,
    *,
    on_select: Callable[[Ids], object] | None = None,
    width: int | Literal["auto"] = "auto",
    height: int | Literal["auto"] = 720,
) -> Any:
    """Return the front as a ``FrontView``, which a notebook shows as the Rerun viewer: pick a point, get its id.

    Its ``selected`` are the ids of the points that were selected last, in any of its pictures, and ``choice`` is the
    point whose motion the arm shows: the first of them, at first the present choice, or else the compromise.
    ``show(id)`` shows another one, ``on_select(callback)`` has a function called with the ids of every selection.

    On a certified front its ``sliders``, one an objective, move along the front: while one is dragged towards its
    better end, what ``predict`` expects is drawn in grey; on release it is the point that ``navigate`` leads to, which
    is selected. ``view.front`` has all points that were moved to.

    The extra ``notebook`` is wanted (``pip install "paretoik[notebook]"``). The viewer is served by this process to the
    same machine; where the browser is on another one, ``RERUN_NOTEBOOK_ASSET=inline`` in the environment sends it
    along.

    Parameters
    ----------
    on_select
        Called with the ids of every selection; may be none.
    width, height
        In pixels; "auto" is the cell's width, and 9/16 of that.

    Raises
    ------
    InvalidInput
        Where the extra is missing, or a size is none.
    Infeasible
        For an empty front.
    """
    for edge, size in {"width": width, "height": height}.items():
        if not (isinstance(size, str) and size == "auto"):
            check_size(edge, size, 1)
    check_function("on_select", on_select)
    return drawn_by(OPENED_BY)(front, on_select=on_select, width=width, height=height)


def show_choice(front: Front) -> None:
    """Let the recording of a front's run, if there is one, open on the present choice."""
    if front.folder is not None and (front.folder / RECORDING).exists():
        drawn_by(RECORDED_BY)(front)


def drawn_by(reference: str) -> Any:
    """Return the function that "module:name" stands for."""
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)


# Choosing a point of a front by a preference, and going back on it; a run folder keeps the choices.


def select(front: Front, preference: Preference | str | Mapping[str, float] | int, *, keep: bool = True) -> Choice:
    """Return the point that a preference chooses; a closed loop is followed again with it.

    ``preference`` is one of those of ``paretoik`` or your own (``Preference``); "knee" and "compromise" stand for
    ``Knee()`` and ``Compromise()``, numbers by objective for ``Weights``, an integer for the point with that id.
    A front with a run ``folder`` keeps the choice there, in choices.json (``choices``), and has its recording,
    review.rrd, open on it, unless ``keep`` is False or it is the motion of a closed loop that was followed anew. A
    recording that cannot be replaced is left as it is, with a warning; the choice is kept.

    Raises Infeasible where the front is empty or no point suits, and InvalidInput for other preferences.
    """
    from paretoik.front.choice_tree import keep_choice
    from paretoik.front.preferences.requests import as_preference, ask

    check_flag("keep", keep)
    check_has_points(front, "select")
    wish = as_preference(preference)
    of_problem: Callable[[Front, Preference], Choice] | None = getattr(front.problem, "select", None)
    choice = ask(wish, front) if of_problem is None else of_problem(front, wish)
    is_known = np.array_equal(choice.objectives, front.objectives[choice.index])  # no loop that was followed anew
    if keep and is_known and front.folder is not None and keep_choice(front, choice, wish):
        show_choice(front)
    return choice


def undo(front: Front) -> Choice | None:
    """Go back to the choice before the present one in the run folder, and return it; None where it was the first.

    Nothing is deleted: the next choice becomes another branch of the tree. Raises InvalidInput where there is no
    choice to go back from, or this is a part of the run's front without the point of the one before.
    """
    from paretoik.front.choice_tree import chosen, go_back

    if front.folder is None:
        raise InvalidInput("undo: wants a front that was loaded from a run folder or saved into one")
    go_back(front.folder, front=front)
    show_choice(front)
    return chosen(front)


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
        from paretoik.front.choice_tree import Choices, read_choices

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
