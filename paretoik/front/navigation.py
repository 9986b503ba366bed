"""Moves along a front and predictions of them: what is asked for, checked, and what is remembered of each move.

A front asks its problem to move (``navigate`` of ``formulations.protocol``). What became of it stands in words in
``front.navigated.reason``, and in numbers in ``front.provenance["navigations"]``, one entry a move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import WEIGHT_TOLERANCE
from paretoik.front.choice import Prediction
from paretoik.front.points import NAVIGATIONS, check_known, row_of
from paretoik.inputs import check_size, finite_number, listed, read_list, shown

if TYPE_CHECKING:  # a front asks this file to move
    from paretoik.front.front import Choice, Front


@dataclass(frozen=True, kw_only=True)
class NavigationDefaults:
    """A point counts as critical up to ``critical``; a move is a ``share`` of the range, or half of what remains.

    A gain of less than ``smallest_gain``, a share of the range, is none; more than ``largest_gain`` of them is a slip,
    and numbers as large end solvers, not searches.
    """

    critical: float = 1e-6
    share: float = 0.05
    smallest_gain: float = 1e-6
    remaining: float = 0.5
    points: int = 4
    largest_gain: float = 1e3


DEFAULTS = NavigationDefaults()


@dataclass(frozen=True, kw_only=True)
class NavigationRequest:
    """Improve objective ``improve`` of the point in ``row`` by ``by``, in its own unit; ``payers`` may get worse."""

    row: int
    improve: int
    by: float
    payers: tuple[int, ...]


def navigate(
    front: Front,
    choice: Choice | int | None = None,
    *,
    improve: str,
    allow: str | Sequence[str] | None = None,
    hold: str | Sequence[str] = (),
    by: float | None = None,
    to: float | None = None,
) -> Front:
    """Return the front with a new certified point that improves an objective: ``front.navigated``, and what happened.

    The former points stay, with their ids, unless the new one dominates them; the new id was never used. Where a point
    is there already, ``navigated`` is that point and nothing is added.

    Parameters
    ----------
    choice
        The point to move from: a choice, or an id; by default the present choice of the front's run.
    improve
        The objective that gets better: ``by`` so much, or ``to`` a value, in its own unit. By default by 5 % of its
        range, or half of what remains to its best value on the front if that is less.
    allow
        Who pays, by name: the others get no worse. By default all that are not on ``hold``. Several pay alike, in
        shares of their ranges.
    hold
        Who gets no worse, by name.

    The point is followed along its branch by exact second derivatives while limits come and go; where the branch ends
    optima are sought anew from there and from neighbours, and ``front.navigated.reason`` says so. It also says what
    share of the wish was met where the front ends before.

    Raises
    ------
    InvalidInput
        Before any work: for a front without certificates or problem, a point that is not critical, names that are none,
        or an objective that nothing can improve there.
    Infeasible
        Where no point was found that is better in this objective.
    """
    request = _request(front, "navigate", choice, improve, allow, hold, by, to)
    moved: Front = _part(front, "navigate")(front, request)
    return moved


def predict(
    front: Front,
    choice: Choice | int | None = None,
    *,
    improve: str,
    allow: str | Sequence[str] | None = None,
    hold: str | Sequence[str] = (),
    by: float | None = None,
    to: float | None = None,
) -> Prediction:
    """Return where ``navigate`` with the same arguments is expected to lead: a prediction, no point of the front.

    Derivatives at the point predict its branch, limits that come and go included; nothing is corrected or certified,
    and there is no id. The objective that improves does so by as much as asked for, the others err by the fourth power
    of that, and limits are kept nearly. Jumps are not foreseen.

    Raises
    ------
    InvalidInput
        As ``navigate`` does, and where optima cannot be followed: past kinks, or where functions relate samples.
    Infeasible
        Where derivatives reach no prediction, such as past the end of the branch.
    """
    request = _request(front, "predict", choice, improve, allow, hold, by, to)
    prediction: Prediction = _part(front, "predict")(front, request)
    return prediction


def refine_around(front: Front, choice: Choice | int | None = None, *, points: int = DEFAULTS.points) -> Front:
    """Return the front with up to so many new certified points around one of its points.

    Every objective in turn is improved by even shares of the way to the nearest point that is better in it, all others
    paying. Where a share leads to no new point there is none. Raises InvalidInput as ``navigate`` does.
    """
    check_size("points", points, 1)
    row = _critical_row(front, choice, "refine_around")
    move, id = _part(front, "refine_around", "navigate"), int(front.ids[row])
    values, widths = front.minimised, np.ptp(front.ranges, axis=1)
    for k, share in _places(values[row], values, points):
        better = values[:, k] < values[row, k]
        by = share * float((values[row, k] - values[better, k]).min())
        if by > DEFAULTS.smallest_gain * widths[k]:
            payers = tuple(j for j in range(len(front.names)) if j != k)
            here = row_of(front, id)
            try:
                front = move(front, NavigationRequest(row=here, improve=k, by=by, payers=payers))
            except Infeasible:  # nothing was found there; what was found before stays
                continue
            if id not in front:  # a better point came in its place
                break
    return front


def navigated(front: Front) -> Choice | None:
    """Return the point that the last move led to, its reason saying how; None where there was none."""
    moves = front.provenance.get(NAVIGATIONS, ())
    return front[moves[-1]["to"]] if moves and moves[-1]["to"] in front else None


def verdict_on(front: Front, row: int) -> str:
    """Return what is said of the point of a row that was named: how a move led to it, where one did."""
    id = int(front.ids[row])
    moves = [move for move in front.provenance.get(NAVIGATIONS, ()) if move["to"] == id]
    return str(moves[-1]["reason"]) if moves else f"Point {id} was named."


def _places(value: np.ndarray, values: np.ndarray, points: int) -> list[tuple[int, float]]:
    """Return objectives that some point is better in, and shares of the way there, spread evenly."""
    axes = [k for k in range(len(value)) if (values[:, k] < value[k]).any()]
    counts = [len(range(i, points, len(axes))) for i in range(len(axes))]
    return [(k, (j + 1) / (count + 1)) for k, count in zip(axes, counts, strict=True) for j in range(count)]


def _part(front: Front, verb: str, part: str | None = None) -> Callable[[Front, NavigationRequest], Any]:
    """Return what the problem of a front offers for a verb, by default under its name."""
    if front.problem is None:
        raise InvalidInput(
            f"{verb}: wants the problem of the front, which is not at hand: load_front(run, problem), or "
            "--problem FILE.py:NAME"
        )
    offered: Callable[[Front, NavigationRequest], Any] | None = getattr(front.problem, part or verb, None)
    if offered is None:
        kind = type(front.problem).__name__
        raise InvalidInput(f"{verb}: wants a problem with gradients, such as Tracking, got a front of {kind}")
    return offered


def _request(
    front: Front,
    verb: str,
    choice: Choice | int | None,
    improve: str,
    allow: str | Sequence[str] | None,
    hold: str | Sequence[str],
    by: float | None,
    to: float | None,
) -> NavigationRequest:
    row = _critical_row(front, choice, verb)
    _part(front, verb)
    if not isinstance(improve, str):
        raise InvalidInput(f"improve: the name of an objective wanted, got {shown(improve)}")
    (k,) = _axes(front, "improve", [improve])
    if len(front.names) < 2:
        raise InvalidInput(f"{verb}: wants two objectives or more, got one: nothing pays for it")
    fixed = _axes(front, "hold", hold)
    others = [axis for axis in range(len(front.names)) if axis != k]
    payers = [axis for axis in others if axis not in fixed] if allow is None else _axes(front, "allow", allow)
    for name, axes in (("allow", payers), ("hold", fixed)):
        if k in axes:
            raise InvalidInput(f"{name}: wants objectives other than what is to improve, got {improve}")
    both = [front.names[axis] for axis in payers if axis in fixed]
    if both or not payers:
        raise InvalidInput(f"allow: wants objectives that are not on hold, got {', '.join(both) or 'none'}")
    step = _step(front, verb, row, k, by, to)
    _check_not_at_end(front, row, k, payers)
    return NavigationRequest(row=row, improve=k, by=step, payers=tuple(payers))


def _step(front: Front, verb: str, row: int, axis: int, by: float | None, to: float | None) -> float:
    """Return by how much to improve an objective, in its own unit."""
    name, value = front.names[axis], float(front.objectives[row, axis])
    if by is not None and to is not None:
        raise InvalidInput(f"{verb}: wants by= or to=, got both")
    if by is not None:
        by = finite_number("by", by)
        if by <= 0:
            raise InvalidInput(f"by: wants more than 0 {front.units[axis]} of {name}, got {by:g}")
        _check_gain(front, axis, "by", by)
        return by
    if to is not None:
        gain = (finite_number("to", to) - value) * (1.0 if front.maximised[axis] else -1.0)
        if gain <= 0:
            raise InvalidInput(f"to: wants better than {front.quantity(axis, value)}, got {to:g}")
        _check_gain(front, axis, "to", gain)
        return gain
    remaining = float((front.minimised[row, axis] - front.minimised[:, axis]).max())
    share = DEFAULTS.share * float(np.ptp(front.ranges[axis]))
    if max(remaining, share) <= 0.0:
        raise InvalidInput(f"by: wants how much to improve {name}, of which the front has but one value")
    return min(share, DEFAULTS.remaining * remaining) if 0.0 < remaining < 2 * share else share


def _check_gain(front: Front, axis: int, label: str, gain: float) -> None:
    """Raise InvalidInput for a gain that is out of all proportion to the range of an objective."""
    largest = DEFAULTS.largest_gain * float(np.ptp(front.ranges[axis]))
    if gain > largest > 0.0:
        raise InvalidInput(f"{label}: wants a gain of at most {front.quantity(axis, largest)}, got {gain:g}")


def _check_not_at_end(front: Front, row: int, axis: int, payers: Sequence[int]) -> None:
    """Raise InvalidInput where no payer has weight, and no known point is better."""
    assert front.certificates is not None
    weight = float(front.certificates.weights[row, list(payers)].sum())
    if weight < WEIGHT_TOLERANCE and not (front.minimised[:, axis] < front.minimised[row, axis]).any():
        raise InvalidInput(
            f"improve: wants an objective that can get better, got point {front.ids[row]}, the end of the front in "
            f"{front.names[axis]}"
        )


def _critical_row(front: Front, choice: Choice | int | None, verb: str) -> int:
    """Return the row of a choice, by default the present one, that is certified as critical."""
    from paretoik.front.choice_tree import present_id

    id = present_id(front, name=verb) if choice is None else getattr(choice, "id", choice)
    row = row_of(front, id, name=verb)
    if front.certificates is None:
        raise InvalidInput(f"{verb}: wants a front with certificates, such as refine(front), got one without")
    residual = float(front.certificates.criticality[row])
    if not residual <= DEFAULTS.critical:
        critical = front.ids[front.certificates.criticality <= DEFAULTS.critical]
        others = f"critical are {listed(map(str, critical))}" if len(critical) else "refine the front first"
        raise InvalidInput(
            f"{verb}: wants a critical point, got point {front.ids[row]} of residual {residual:.1e}: {others}"
        )
    return row


def _axes(front: Front, label: str, names: str | Sequence[str]) -> list[int]:
    """Return which objectives are named."""
    names = read_list(label, [names] if isinstance(names, str) else names, str, "names of objectives")
    check_known(front, label, names)
    return list(dict.fromkeys(front.names.index(name) for name in names))
