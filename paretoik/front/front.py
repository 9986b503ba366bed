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

# A front in a notebook: the Rerun viewer below a cell.


# Names, so that this package does not depend on those that draw.
OPENED_BY = "paretoik.review.drawing.front_view:open_view"
RECORDED_BY = "paretoik.review.drawing.choice_layer:show_choice_in_recording"


def view(
    front: Front,
    *,
    on_select: Callable[[Ids], object] | None = None,
    width: int | Literal["auto"] = "auto",
    height: int | Literal["auto"] = 720,
) -> Any:
    """Return the front as a ``FrontView``, which a notebook shows as the Rerun viewer.

    ``selected`` has the ids of the points that were selected last, in any of its pictures. ``choice`` is the point
    whose motion the arm shows: the first selected one; at first the present choice, or else the compromise.
    ``show(id)`` shows another one; ``on_select(callback)`` sets a function that gets the ids of every selection.

    On a certified front ``sliders``, one per objective, move along the front: while one is dragged towards its better
    end, the point that ``predict`` expects is drawn in grey; on release the point that ``navigate`` reaches is
    selected. ``view.front`` has all points that were reached.

    The view needs the extra ``notebook`` (``pip install "paretoik[notebook]"``). This process serves the viewer to the
    same machine; if the browser runs on another one, ``RERUN_NOTEBOOK_ASSET=inline`` in the environment sends it along.

    Parameters
    ----------
    on_select
        Function that is called with the ids of every selection; may be None.
    width, height
        Sizes in pixels; "auto" is the cell's width, and 9/16 of that.

    Raises
    ------
    InvalidInput
        If the extra is missing, or a size is invalid.
    Infeasible
        If the front is empty.
    """
    for edge, size in {"width": width, "height": height}.items():
        if not (isinstance(size, str) and size == "auto"):
            check_size(edge, size, 1)
    check_function("on_select", on_select)
    return drawn_by(OPENED_BY)(front, on_select=on_select, width=width, height=height)


def show_choice(front: Front) -> None:
    """Make the recording of a front's run, if there is one, open on the present choice."""
    if front.folder is not None and (front.folder / RECORDING).exists():
        drawn_by(RECORDED_BY)(front)


def drawn_by(reference: str) -> Any:
    """Return the function named by "module:name"."""
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)


# Choosing a point of a front by a preference, and undoing a choice.


def select(front: Front, preference: Preference | str | Mapping[str, float] | int, *, keep: bool = True) -> Choice:
    """Return the point that a preference chooses; a closed loop is followed again with it.

    preference: one of ``paretoik`` or your own (``Preference``); "knee" and "compromise" stand for ``Knee()`` and
        ``Compromise()``, numbers by objective for ``Weights``, an integer for the point with that id
    keep: whether a front with a run ``folder`` keeps the choice there, in choices.json (``choices``), and its
        recording, review.rrd, opens on it; a new motion of a closed loop is never kept

    A recording that cannot be replaced stays as it is, with a warning; the choice is kept.
    Raises Infeasible if the front is empty or no point suits, and InvalidInput for other preferences.
    """
    from paretoik.front.choice_tree import keep_choice
    from paretoik.front.preferences.requests import as_preference, ask

    check_flag("keep", keep)
    check_has_points(front, "select")
    wish = as_preference(preference)
    of_problem: Callable[[Front, Preference], Choice] | None = getattr(front.problem, "select", None)
    choice = ask(wish, front) if of_problem is None else of_problem(front, wish)
    is_known = np.array_equal(choice.objectives, front.objectives[choice.index])  # no loop that was followed again
    if keep and is_known and front.folder is not None and keep_choice(front, choice, wish):
        show_choice(front)
    return choice


def undo(front: Front) -> Choice | None:
    """Go back to the choice before the present one in the run folder; return it, or None after the first.

    Nothing is deleted: the next choice becomes another branch of the tree. Raises InvalidInput if there is no choice to
    go back from, or if this part of the run's front does not have the point of the choice before.
    """
    from paretoik.front.choice_tree import chosen, go_back

    if front.folder is None:
        raise InvalidInput("undo: the front must be loaded from a run folder or saved into one, got no folder")
    go_back(front.folder, front=front)
    show_choice(front)
    return chosen(front)


# The Pareto front as named arrays.


__all__ = ["Choice", "Front", "Preference"]

MotionBuilder = Callable[[np.ndarray, np.ndarray, tuple[str, ...]], JointMotions]


@dataclass(frozen=True, kw_only=True, eq=False)
class Front:
    """Mutually non-dominated points, sorted by the first objective.

    Points may be given in any order; they are checked, sorted, copied and made read-only. An empty front is a result
    too: no feasible point.

    ids: unique numbers (points,) that are never reused
    objectives: values (points, n_obj) in the user's own sign
    names, units, maximised: one per objective
    genes, motions: array (points, genes) and batch of motions; both may be missing
    violation: largest violation (points,) as a share of its limit's range
    certificates: those of refined points
    ranges: lower and upper values (n_obj, 2) that preferences measure against, by default those of the front itself
    provenance: description of the run (problem, settings, seed, status), stored in ``run.json``
    problem: the problem itself, not stored
    folder: run folder of the last load or save, in which ``select`` keeps its choices, else None

    ``len(front)`` is the number of points, ``front[12]`` the point with that id as a ``Choice``, ``front[[12, 30]]`` a
    front of two points. ``12 in front`` says whether that id exists. Iterating yields every point as a ``Choice``.

    Raises InvalidInput for shapes that do not agree, values that are not finite, repeated ids or names, names unfit for
    a table, and a point that another one dominates.
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
        """Return the number of points, the range of each objective, and what further points could add."""
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
        """Objectives (points, n_obj), with maximised ones negated, so that less is always better."""
        minimised: Objectives = np.where(self.maximised, -self.objectives, self.objectives)
        return minimised

    @cached_property
    def shares(self) -> Objectives:
        """Place of each point in the ranges (points, n_obj): 0 is best, 1 worst; 0 on a zero range.

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
        """Worst violation of each motion's limits between its samples.

        It is measured if there are no certificates; None without these and without a problem with motions.
        """
        if self.certificates is not None:
            return self.certificates.violation_between
        measure = getattr(getattr(self.problem, "task", None), "violation_between", None)
        return None if measure is None or self.motions is None else measure(self.motions)

    @cached_property
    def jumps(self) -> tuple[tuple[int, int], ...] | None:
        """Pairs of neighbours (ids) between which the front jumps to another branch of optima.

        A barrier lies between the two: points interpolated there are worse than both in some objective, or impossible.
        Navigation from one to the other cannot be continuous there.

        None if this is not defined or not known: unless there are two objectives (others give points no order),
        certificates, and a problem that can interpolate (the one that the front came from).
        """
        return find_jumps(self)

    @cached_property
    def missing_hypervolume(self) -> float | None:
        """Estimated share of the hypervolume that further points could still add, 0 to 1.

        The hypervolume ends at the front's worst values. Between neighbours the front is approximated by the parabola
        that touches the tangents of their exchange rates, or by the chord if these contradict each other or are
        unknown. None for other than two objectives, without certificates, and for fewer than two points.
        """
        return missing_hypervolume(self)

    @overload
    def __getitem__(self, ids: int) -> Choice: ...

    @overload
    def __getitem__(self, ids: Sequence[int] | np.ndarray) -> Front: ...

    def __getitem__(self, ids: Any) -> Choice | Front:
        """Return the point with an id as a choice, or several points as a front of the same ranges.

        Raises InvalidInput for ids that the front does not have.
        """
        if not isinstance(ids, Integral):
            return with_ids(self, ids)
        row = row_of(self, ids)
        return self.choice(row, verdict_on(self, row))

    def __contains__(self, point: object) -> bool:
        """Return whether a point, given as id or choice, is on the front."""
        return has_point(self, point)

    def __iter__(self) -> Iterator[Choice]:
        return (self.choice(row, verdict_on(self, row)) for row in range(len(self)))

    def where(self, bounds: Mapping[str, Bound] | None = None, /, **named: Bound) -> Front:
        """Return the front of the points within bounds, ``front.where(kinetic_energy=(None, 0.05))``.

        A bound is (lower, upper) in the objective's own units and sign, with None for an open side; names that are no
        identifiers need a mapping. Ranges, ids, motions, genes and certificates are kept. The front may be empty.

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
        """The tree of choices kept in the front's run folder; no choices without a folder.

        Raises InvalidRun if the file is damaged.
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
        """Return the point of a row as a choice: a verdict on it, followed by its trade-offs.

        Raises InvalidInput if the front has no such row.
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
        """Return a value of an objective with its name and unit; raises InvalidInput for other values or axes."""
        self._check_index("axis", axis, len(self.names), "an objective")
        value = real_number("value", value)
        return f"{self.names[axis]} {value:.4g} {self.units[axis]}".rstrip()

    def _check_index(self, name: str, index: object, count: int, wish: str) -> None:
        if not is_integer(index) or not 0 <= int(index) < count:
            raise InvalidInput(f"{name} must be {wish} of {count}, from 0 on, got {shown(index)}")

    def save(self, folder: Path | str, *, overwrite: bool = False) -> None:
        """Write `run.json`, `front.parquet` and, with genes or motions, `motions.npz` into `folder`.

        Raises InvalidInput if it contains another run, or points that this front has not, unless ``overwrite`` is set.
        """
        from paretoik.front.storage import save

        check_flag("overwrite", overwrite)
        save(self, file_path("folder", folder), overwrite=overwrite)

    @staticmethod
    def load(folder: Path | str, *, motions: MotionBuilder | None = None) -> Front:
        """Return a saved front; `motions` builds motions from stored times, joint positions and joint names.

        Raises InvalidRun if a file is missing, damaged, a link, of another version, or of another run.
        """
        from paretoik.front.storage import load

        check_function("motions", motions)
        return load(file_path("folder", folder), build_motions=motions)
