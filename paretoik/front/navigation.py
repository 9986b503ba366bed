"""Moves along a front and their predictions: checked requests, and a record of each move.

A front asks its problem to move (``navigate`` of ``formulations.protocol``). ``front.navigated.reason`` has the result
in words, ``front.provenance["navigations"]`` in numbers, one entry per move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import WEIGHT_TOLERANCE
from paretoik.front.choice import Choice, Prediction, explain_named, named_quantity, with_unit
from paretoik.front.choice_tree import present_id
from paretoik.front.points import NAVIGATIONS, Front, FrontData, check_known, row_of
from paretoik.inputs import check_size, finite_number, listed, read_list, shown


@dataclass(frozen=True, kw_only=True)
class NavigationDefaults:
    """Defaults of moves along a front.

    critical: largest criticality of a critical point
    share: default size of a move, as a share of the range
    smallest_gain: smallest gain that counts, as a share of the range
    remaining: largest default size, as a share of the way to the best point
    points: number of new points around a point
    largest_gain: largest gain, as a multiple of the range; larger ones make solvers fail
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
    """Request to improve an objective of the point in ``row`` by ``by``, in its own unit; ``payers`` may get worse."""

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
    """Return the front with a new certified point that improves an objective, ``front.navigated``.

    The former points keep their ids; those that the new one dominates are dropped. The new id was never used. If the
    front already has the point that is reached, ``navigated`` is this point and nothing is added.

    Parameters
    ----------
    choice
        The point to move from: a choice, or an id; by default the present choice of the front's run.
    improve
        The objective that gets better: ``by`` an amount, or ``to`` a value, in its own unit. By default by 5 % of its
        range, or by half the way to its best value on the front if that is less.
    allow
        Names of the objectives that may get worse; the others do not. By default all that are not in ``hold``. Several
        get worse equally, in shares of their ranges.
    hold
        Names of the objectives that do not get worse.

    The point is followed along its branch by exact second derivatives while limits become active or inactive. If the
    branch ends, optima are searched for from its end and from neighbours, and ``front.navigated.reason`` says so. If
    the front ends first, the reason says which share of the gain was reached.

    Raises
    ------
    InvalidInput
        Before any work: for a front without certificates or problem, a point that is not critical, unknown names, or an
        objective that nothing can improve there.
    Infeasible
        If no point was found that is better in this objective.
    """
    request = _request(front, "navigate", choice, improve, allow, hold, by, to)
    moved: Front = _part(front, "navigate")(front, request)
    return moved


def predict(
    front: FrontData,
    choice: Choice | int | None = None,
    *,
    improve: str,
    allow: str | Sequence[str] | None = None,
    hold: str | Sequence[str] = (),
    by: float | None = None,
    to: float | None = None,
) -> Prediction:
    """Return the expected result of ``navigate`` with the same arguments; it is not a point of the front.

    Derivatives at the point predict its branch, with limits that become active or inactive; nothing is corrected or
    certified. The objective to improve gains the requested amount, errors of the others grow with its fourth power, and
    limits are nearly satisfied. Jumps are not predicted.

    Raises
    ------
    InvalidInput
        As ``navigate`` does, and if optima cannot be followed: a function has kinks or relates samples.
    Infeasible
        If no prediction is possible, as beyond the end of the branch.
    """
    request = _request(front, "predict", choice, improve, allow, hold, by, to)
    prediction: Prediction = _part(front, "predict")(front, request)
    return prediction


def refine_around(front: Front, choice: Choice | int | None = None, *, points: int = DEFAULTS.points) -> Front:
    """Return the front with up to ``points`` new certified points around one of its points.

    Each objective is improved by even shares of the way to the next better value on the front; all others may get
    worse. A share adds no point if none is found there. Raises InvalidInput as ``navigate`` does.
    """
    check_size("points", points, 1)
    row = _critical_row(front, choice, "refine_around")
    move, id = _part(front, "refine_around", "navigate"), int(front.ids[row])
    values, widths = front.minimised, np.ptp(front.ranges, axis=1)
    # Points are distributed among the objectives in which some point is better, at even shares of the way to it.
    axes = [k for k in range(len(front.names)) if (values[:, k] < values[row, k]).any()]
    counts = [len(range(i, points, len(axes))) for i in range(len(axes))]
    for k, share in [(k, (j + 1) / (count + 1)) for k, count in zip(axes, counts, strict=True) for j in range(count)]:
        better = values[:, k] < values[row, k]
        by = share * float((values[row, k] - values[better, k]).min())
        if by > DEFAULTS.smallest_gain * widths[k]:
            payers = tuple(j for j in range(len(front.names)) if j != k)
            here = row_of(front, id)
            try:
                front = move(front, NavigationRequest(row=here, improve=k, by=by, payers=payers))
            except Infeasible:  # nothing was found there; the points found before stay
                continue
            if id not in front:  # a better point replaced it
                break
    return front


def navigated(front: FrontData) -> Choice | None:
    """Return the point that the last move reached, with its reason, or None."""
    moves = front.provenance.get(NAVIGATIONS, ())
    return explain_named(front, row_of(front, moves[-1]["to"])) if moves and moves[-1]["to"] in front else None


def _part(front: FrontData, verb: str, part: str | None = None) -> Callable[[Any, NavigationRequest], Any]:
    """Return the method ``part`` of a front's problem, by default the one named like the verb."""
    if front.problem is None:
        raise InvalidInput(
            f"{verb}: the front must have its problem, got none: use load_front(run, problem), or "
            "--problem FILE.py:NAME"
        )
    offered: Callable[[Any, NavigationRequest], Any] | None = getattr(front.problem, part or verb, None)
    if offered is None:
        kind = type(front.problem).__name__
        raise InvalidInput(f"{verb}: the problem must have gradients, such as Tracking, got {kind}")
    return offered


def _request(
    front: FrontData,
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
        raise InvalidInput(f"improve must be the name of an objective, got {shown(improve)}")
    (k,) = _axes(front, "improve", [improve])
    if len(front.names) < 2:
        raise InvalidInput(f"{verb}: there must be two objectives or more, got one: no other can get worse")
    fixed = _axes(front, "hold", hold)
    others = [axis for axis in range(len(front.names)) if axis != k]
    payers = [axis for axis in others if axis not in fixed] if allow is None else _axes(front, "allow", allow)
    for name, axes in (("allow", payers), ("hold", fixed)):
        if k in axes:
            raise InvalidInput(f"{name} must be objectives other than the one to improve, got {improve}")
    both = [front.names[axis] for axis in payers if axis in fixed]
    if both or not payers:
        raise InvalidInput(f"allow must be objectives that are not in hold, got {', '.join(both) or 'none'}")
    step = _step(front, verb, row, k, by, to)
    # At an end of the front no payer has a weight, and no known point is better.
    assert front.certificates is not None
    weight = float(front.certificates.weights[row, payers].sum())
    if weight < WEIGHT_TOLERANCE and not (front.minimised[:, k] < front.minimised[row, k]).any():
        raise InvalidInput(
            f"improve must be an objective that can get better at point {front.ids[row]}, got {improve}: the point is "
            "its end of the front"
        )
    return NavigationRequest(row=row, improve=k, by=step, payers=tuple(payers))


def _step(front: FrontData, verb: str, row: int, axis: int, by: float | None, to: float | None) -> float:
    """Return the amount by which to improve an objective, in its own unit."""
    name, value, width = front.names[axis], float(front.objectives[row, axis]), float(np.ptp(front.ranges[axis]))
    if by is not None and to is not None:
        raise InvalidInput(f"{verb}: the gain must be given as by= or to=, got both")
    if by is None and to is None:
        remaining = float((front.minimised[row, axis] - front.minimised[:, axis]).max())
        share = DEFAULTS.share * width
        if max(remaining, share) <= 0.0:
            raise InvalidInput(f"by must be given to improve {name}, got none: the front has only one value of it")
        return min(share, DEFAULTS.remaining * remaining) if 0.0 < remaining < 2 * share else share
    if by is not None:
        label, gain = "by", finite_number("by", by)
        if gain <= 0:
            raise InvalidInput(f"by must be more than 0 {front.units[axis]} of {name}, got {gain:g}")
    else:
        label, goal = "to", finite_number("to", to)
        gain = (goal - value) * (1.0 if front.maximised[axis] else -1.0)
        if gain <= 0:
            raise InvalidInput(f"to must be better than {named_quantity(front, axis, value)}, got {goal:g}")
    largest = DEFAULTS.largest_gain * width
    if gain > largest > 0.0:
        limit = with_unit(front, name, f"{largest:.4g}")
        raise InvalidInput(f"{label}: the gain in {name} must be at most {limit}, got {gain:g}")
    return gain


def _critical_row(front: FrontData, choice: Choice | int | None, verb: str) -> int:
    """Return the row of a choice, by default the present one; it must be certified as critical."""
    id = present_id(front, name=verb) if choice is None else getattr(choice, "id", choice)
    row = row_of(front, id, name=verb)
    if front.certificates is None:
        raise InvalidInput(f"{verb}: the front must have certificates, as from refine(front), got none")
    residual = float(front.certificates.criticality[row])
    if not residual <= DEFAULTS.critical:
        critical = front.ids[front.certificates.criticality <= DEFAULTS.critical]
        others = f"critical points are {listed(map(str, critical))}" if len(critical) else "refine the front first"
        raise InvalidInput(
            f"{verb}: the point must be critical, got point {front.ids[row]} of criticality {residual:.1e}: {others}"
        )
    return row


def _axes(front: FrontData, label: str, names: str | Sequence[str]) -> list[int]:
    """Return the indices of named objectives."""
    names = read_list(label, [names] if isinstance(names, str) else names, str, "names of objectives")
    check_known(front.names, label, names)
    return list(dict.fromkeys(front.names.index(name) for name in names))
