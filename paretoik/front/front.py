"""The Pareto front as named arrays, with its methods."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from numbers import Integral
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from paretoik.arrays import Ids
from paretoik.errors import InvalidInput
from paretoik.front import navigation, storage
from paretoik.front.choice import Choice, Preference, check_preference, explain, explain_named, named_quantity
from paretoik.front.choice_tree import Choices, chosen, go_back, keep_choice, kept_choices
from paretoik.front.points import (
    Bound,
    FrontData,
    MotionBuilder,
    bounds_by_axis,
    check_has_points,
    inside,
    merge_bounds,
    row_of,
    rows_of,
    take,
)
from paretoik.front.preferences.requests import as_preference, ask
from paretoik.handed_down import HANDED_DOWN
from paretoik.inputs import (
    check_flag,
    check_function,
    check_mapping,
    check_size,
    file_path,
    is_integer,
    real_number,
    shown,
)
from paretoik.runs.files import RECORDING
from paretoik.tables import fit_screen, html_representation

__all__ = ["Choice", "Front", "Preference"]


def view(
    front: Front,
    *,
    on_select: Callable[[Ids], object] | None = None,
    width: int | Literal["auto"] = "auto",
    height: int | Literal["auto"] = 720,
) -> Any:
    """Return the front as a ``FrontView``, which a notebook shows as the Rerun viewer.

    ``selected`` has the ids of the points that were selected last, in any of its pictures. ``choice`` is the point
    whose motion the arm shows: the first selected one; if none is, the present choice, or else the compromise.
    ``show(id)`` shows another one; ``on_select(callback)`` sets a function that gets the ids of every selection.

    On a certified front there are ``sliders``, one per objective, to move along the front. While one is dragged towards
    its better end, the point that ``predict`` expects is drawn in grey. On release, the point that ``navigate`` reaches
    is selected. ``view.front`` is the front with all points that were reached.

    The view needs the extra ``notebook`` (``pip install "paretoik[notebook]"``). This process serves the viewer to
    browsers on its own machine; for others set ``RERUN_NOTEBOOK_ASSET=inline`` in the environment.

    Parameters
    ----------
    on_select
        Function that is called with the ids of every selection; may be None.
    width, height
        Sizes in pixels; "auto" is the width of the notebook's cell, and 9/16 of it as the height.

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
    for package in ("rerun_notebook", "anywidget"):
        if find_spec(package) is None:
            name = package.replace("_", "-")
            raise InvalidInput(f'view: the package {name} must be installed: pip install "paretoik[notebook]"')
    check_has_points(front, "view")
    return HANDED_DOWN["open_view"](front, on_select=on_select, width=width, height=height)


def show_choice(front: Front) -> None:
    """Set the recording of a front's run, if any, to open on the present choice."""
    if front.folder is not None and (front.folder / RECORDING).exists():
        HANDED_DOWN["show_choice"](front)


def select(front: Front, preference: Preference | str | Mapping[str, float] | int, *, keep: bool = True) -> Choice:
    """Return the point that a preference chooses.

    A closed loop follows its path again with the preference at every step.

    preference: one of ``paretoik`` or your own (``Preference``); "knee" and "compromise" stand for ``Knee()`` and
        ``Compromise()``, numbers by objective for ``Weights``, an integer for the point with that id
    keep: whether the choice is kept in the run ``folder``, if there is one: in choices.json (``choices``), and as the
        point on which its recording, review.rrd, opens; a new motion of a closed loop is never kept

    A recording that cannot be replaced stays as it is, with a warning; the choice is kept.
    Raises Infeasible if the front is empty or no point suits, and InvalidInput for other preferences.
    """
    check_flag("keep", keep)
    check_has_points(front, "select")
    wish = as_preference(preference)
    of_problem: Callable[[Front, Preference], Choice] | None = getattr(front.problem, "select", None)
    choice = ask(wish, front) if of_problem is None else of_problem(front, wish)
    is_known = np.array_equal(choice.objectives, front.objectives[choice.index])  # False for a new motion of a loop
    if keep and is_known and front.folder is not None and keep_choice(front, choice, wish):
        show_choice(front)
    return choice


def undo(front: Front) -> Choice | None:
    """Go back to the previous choice in the run folder, and return it.

    Returns None if the first choice was undone. Nothing is deleted: the next choice becomes another branch of the tree.
    Raises InvalidInput if there is no choice, or if this front is only a part of the run's front and does not have the
    point of the previous choice.
    """
    if front.folder is None:
        raise InvalidInput("undo: the front must be loaded from a run folder or saved into one, got no folder")
    go_back(front.folder, front=front)
    show_choice(front)
    return chosen(front)


@dataclass(frozen=True, kw_only=True, eq=False)
class Front(FrontData):
    """Mutually non-dominated points, sorted by the first objective.

    Points may be given in any order; they are checked, sorted, copied and made read-only. An empty front is valid: no
    point was feasible.

    ids: unique numbers (points,) that are never reused
    objectives: values (points, n_obj) in the user's own sign
    names, units, maximised: lists with one item per objective
    genes: array (points, genes), or None
    motions: batch of motions, or None
    violation: largest violation (points,) as a share of its limit's range, or None
    certificates: certificates of refined points, or None
    ranges: lowest and highest values (n_obj, 2) that define shares for preferences, by default the front's own
    provenance: description of the run (problem, settings, seed, status), stored in ``run.json``
    problem: the problem itself, not stored
    folder: run folder of the last load or save, in which ``select`` keeps choices; None without one

    ``len(front)`` is the number of points, ``front[12]`` the point with that id as a ``Choice``, ``front[[12, 30]]`` a
    front of two points. ``12 in front`` says whether that id exists. Iterating yields every point as a ``Choice``.

    Raises InvalidInput for inconsistent shapes, values that are not finite, repeated ids or names, names unfit for a
    table, and dominated points.
    """

    def __repr__(self) -> str:
        """Return text on points, ranges and the hypervolume that further points could add."""
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
            f"; further points could add about {100 * missing:.2g} % of the hypervolume" if missing is not None else ""
        )
        return fit_screen(f"Front of {points}: {', '.join(ranges)}{further}")

    _repr_html_ = html_representation

    @overload
    def __getitem__(self, ids: int) -> Choice: ...

    @overload
    def __getitem__(self, ids: Sequence[int] | np.ndarray) -> Front: ...

    def __getitem__(self, ids: Any) -> Choice | Front:
        """Return one point by its id as a choice, or several as a front.

        The new front has the order and the ranges of this one. Raises InvalidInput for ids that repeat or that the
        front does not have.
        """
        if isinstance(ids, Integral):
            return explain_named(self, row_of(self, ids))
        is_row = isinstance(ids, Sequence | np.ndarray) and not isinstance(ids, str)
        array = np.asarray(ids) if is_row else np.empty((0, 0))
        if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
            raise InvalidInput(f"front index must be an id or a list of ids, got {shown(ids)}")
        return take(self, rows_of(self, array, "front"))

    def __iter__(self) -> Iterator[Choice]:
        return (explain_named(self, row) for row in range(len(self)))

    def where(self, bounds: Mapping[str, Bound] | None = None, /, **named: Bound) -> Front:
        """Return the front of the points within bounds, as in ``front.where(kinetic_energy=(None, 0.05))``.

        A bound is (lower, upper) in the objective's own units and sign, with None for an open side. Names that are not
        identifiers need a mapping. Ranges, ids, motions, genes and certificates are kept. The front may be empty.

        Raises InvalidInput for other names and bounds.
        """
        limits = bounds_by_axis(self, merge_bounds("where", bounds, named), name="where")
        return take(self, np.flatnonzero(inside(self, limits)))

    select = select
    undo = undo
    navigate = navigation.navigate
    predict = navigation.predict
    refine_around = navigation.refine_around
    navigated = property(navigation.navigated)
    view = view

    @property
    def choices(self) -> Choices:
        """The tree of choices kept in the front's run folder; empty without a folder.

        Raises InvalidRun if the file is damaged.
        """
        return kept_choices(self)

    def choice(
        self,
        index: int,
        verdict: str,
        *,
        preference: Preference | None = None,
        score: float | None = None,
        details: Mapping[str, Any] | None = None,
    ) -> Choice:
        """Return the point of a row as a choice; its reason adds trade-offs to the verdict.

        Raises InvalidInput if the front has no such row.
        """
        self._check_index("index", index, len(self), "a row's number")
        if preference is not None:
            check_preference("preference", preference)
        if details is not None:
            check_mapping("details", details, "numbers by name")
        return explain(self, int(index), verdict, preference=preference, score=score, details=details)

    def quantity(self, axis: int, value: float) -> str:
        """Return a value of an objective with name and unit; raises InvalidInput for an invalid value or axis."""
        self._check_index("axis", axis, len(self.names), "an objective's number")
        return named_quantity(self, axis, real_number("value", value))

    def _check_index(self, name: str, index: object, count: int, wish: str) -> None:
        if not is_integer(index) or not 0 <= int(index) < count:
            raise InvalidInput(f"{name} must be {wish}, >= 0 and < {count}, got {shown(index)}")

    def save(self, folder: Path | str, *, overwrite: bool = False) -> None:
        """Write `run.json`, `front.parquet` and, with genes or motions, `motions.npz` into `folder`.

        Raises InvalidInput if the folder contains another run, or points that this front does not have, unless
        ``overwrite`` is set.
        """
        check_flag("overwrite", overwrite)
        storage.save(self, file_path("folder", folder), overwrite=overwrite)

    @staticmethod
    def load(folder: Path | str, *, motions: MotionBuilder | None = None) -> Front:
        """Return a saved front; `motions` builds its motions from stored times, joint positions and joint names.

        Raises InvalidRun if a file is missing, damaged, a link, of another version, or of another run.
        """
        check_function("motions", motions)
        return storage.load(file_path("folder", folder), make=Front, build_motions=motions)
