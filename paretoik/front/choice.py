"""A chosen point, its explanation, and the protocol of preferences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from paretoik.arrays import Mask, Values
from paretoik.errors import InvalidInput
from paretoik.front.certificates import WEIGHT_TOLERANCE
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.points import NAVIGATIONS, FrontData, merge_named
from paretoik.inputs import check_text, finite_number, shown
from paretoik.tables import fit_screen, html_representation, represented

if TYPE_CHECKING:
    Front = Any  # stands for ``front.Front`` in annotations of preferences


def named_numbers(
    kind: str, mapping: Mapping[str, float] | None, keywords: Mapping[str, float], *, signed: bool = True
) -> Mapping[str, float]:
    """Return a read-only mapping of objectives to numbers, at least 0 unless ``signed``.

    Raises InvalidInput for other values and repeated names.
    """
    merged: Mapping[str, Any] = merge_named(kind, mapping, keywords, "numbers", "{'energy': 0.3}")
    for name, value in merged.items():
        try:
            is_number = not isinstance(value, bool) and isinstance(value, Real) and np.isfinite(float(value))
        except OverflowError:  # an integer too large for a float
            is_number = False
        if not is_number or (value < 0 and not signed):
            wish = "a finite number" if signed else "a finite number >= 0"
            raise InvalidInput(f"{kind}: {name} must be {wish}, got {shown(value)}")
    return MappingProxyType({name: float(value) for name, value in merged.items()})


def named_text(numbers: Mapping[str, float]) -> str:
    """Return numbers by objective as keyword arguments, or as a dict if a name is not an identifier."""
    identifiers = all(name.isidentifier() for name in numbers)
    return ", ".join(f"{name}={value:g}" for name, value in numbers.items()) if identifiers else str(dict(numbers))


def first_row(front: FrontData, scores: Values, among: Mask | None = None) -> int:
    """Return the row with the least score; ``scores`` (points,) are in shares of the ranges.

    Scores within rounding of the least are equal. Ties are decided by the lowest sum of shares ΣZ, then by the best
    first objective, the second and so on, then by the lowest id. ``among`` marks the rows to compare, at least one;
    None means all.
    """
    rows = np.arange(len(front)) if among is None else np.flatnonzero(among)
    for values in (scores, front.shares.sum(axis=1)):
        rows = rows[values[rows] <= values[rows].min() + OPTIONS.rounding]
    order = np.lexsort((front.ids[rows], *front.minimised[rows].T[::-1]))
    return int(rows[order[0]])


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Expected result of a move along a front: objectives (n_obj,) in the user's own sign, and the motion.

    It is not a point of the front: it has no id and no certificate. It has a ``motion`` if the front has motions.
    """

    objectives: Values
    names: Sequence[str]
    units: Sequence[str]
    motion: Any = None

    def __repr__(self) -> str:
        values = (
            f"{name} {value:.4g} {unit}".rstrip()
            for name, value, unit in zip(self.names, self.objectives, self.units, strict=True)
        )
        return fit_screen(f"Prediction, not certified: {', '.join(values)}")

    _repr_html_ = html_representation


@represented
@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Another point compared with the chosen one.

    better_in: objectives in which the other point is the best or, for a neighbour, the nearest better one
    gains: positive amounts by which the other point is better, by objective, in natural units
    costs: positive amounts by which it is worse
    """

    id: int
    better_in: tuple[str, ...]
    gains: Mapping[str, float]
    costs: Mapping[str, float]


@represented
@dataclass(frozen=True, kw_only=True)
class ExchangeRate:
    """Loss in objective ``cost`` per unit gained in objective ``gain`` at the chosen point, the others fixed.

    low, high: bounds of the rate from the certificate, in units of ``cost`` per unit of ``gain``
    holds_to: id of the farthest point up to which all rates for ``gain`` predict the losses within 10 %
    holds_for: gain of that point, else 0
    fails_at: id of the next point; its losses are off by more than 10 %, or it is on another branch

    Ids are None if there is no such point or rates are missing.
    """

    gain: str
    cost: str
    low: float
    high: float
    holds_to: int | None = None
    holds_for: float = 0.0
    fails_at: int | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One point of a front, and the reason of the choice.

    id, index: id and row of the point
    objectives, motion: its values and its motion
    reason: why it was chosen, as at most five bullets, made from the other fields
    verdict: text of the first bullet, from the preference
    preference: preference that chose the point
    score: number that the preference minimises, or None
    details: other results of the preference, by name
    shares: distance of each objective from the best value of its stored range, as a share of this range
    ends: comparisons with the best point of each objective
    neighbours: for each objective, comparison with the nearest point (in shares) that is better in it
    rates: certified exchange rates
    jumps: pairs of ids, one of them this point's, between which the front jumps to another branch
    """

    id: int
    index: int
    objectives: Values
    reason: str
    motion: Any = None
    verdict: str = ""
    preference: Any = None
    score: float | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    shares: Values = field(default_factory=lambda: np.empty(0))
    ends: tuple[Comparison, ...] = ()
    neighbours: tuple[Comparison, ...] = ()
    rates: tuple[ExchangeRate, ...] = ()
    jumps: tuple[tuple[int, int], ...] = ()

    def __repr__(self) -> str:
        return fit_screen(f"Choice of point {self.id}\n{self.reason}")

    _repr_html_ = html_representation


@runtime_checkable
class Preference(Protocol):
    """A rule that chooses one point of a front; the front is never empty.

    ``choose`` returns ``front.choice(row, verdict)``: the row of the point, and a sentence that says why. The front
    adds the point's gains and costs compared with other points. Use ``front.shares``: they refer to the stored ranges,
    so that further points do not move the choice. In ``front.minimised`` less is better for every objective.

    >>> import numpy as np, paretoik as pk
    >>> class Median:
    ...     def choose(self, front):
    ...         return front.choice(len(front) // 2, "Half of the points have less energy.")
    >>> front = pk.Front(ids=np.arange(3), objectives=np.array([[1.0, 9.0], [2.0, 4.0], [3.0, 1.0]]),
    ...                  names=["energy", "torque"], units=["J", "N m"], maximised=[False, False])
    >>> choice = front.select(Median())
    >>> choice.id, choice.verdict
    (1, 'Half of the points have less energy.')
    """

    def choose(self, front: Front) -> Choice:
        """Return the preferred point of `front`."""


def check_preference(name: str, value: object) -> None:
    """Raise InvalidInput unless a value has a method ``choose``.

    Classes and arrays are refused too.
    """
    if not callable(getattr(type(value), "choose", None)) or isinstance(value, type | np.ndarray):
        raise InvalidInput(f"{name}: must be a preference, such as Weights(...), got {shown(value)}")


# The explanation of a point: ends of the front, neighbours, exchange rates and how far they hold.


def explain(
    front: FrontData,
    row: int,
    verdict: str,
    *,
    preference: Any = None,
    score: float | None = None,
    details: Mapping[str, Any] | None = None,
) -> Choice:
    """Return the point of a row as a choice with its reason.

    Raises InvalidInput if the verdict is not one line of text, or the score is not finite.
    """
    check_text("verdict", verdict)
    if score is not None:
        finite_number("score", score)
    choice = Choice(
        id=int(front.ids[row]),
        index=row,
        objectives=front.objectives[row],
        motion=None if front.motions is None else front.motions[row],
        reason="",
        verdict=verdict,
        preference=preference,
        score=score,
        details=MappingProxyType(dict(details or {})),
        shares=front.shares[row],
        ends=compare_better(front, row, nearest=False),
        neighbours=compare_better(front, row, nearest=True),
        rates=exchange_rates(front, row),
        jumps=tuple(pair for pair in front.jumps or () if int(front.ids[row]) in pair),
    )
    facts = [] if len(front) == 1 else [*_trade_offs(front, choice), " ".join(_rates(front, choice))]
    return replace(choice, reason="\n".join(f"- {text}" for text in (verdict, *facts) if text))


def explain_named(front: FrontData, row: int) -> Choice:
    """Return a row's point as a choice that was made by id.

    If a move along the front led to the point, the verdict gives the reason for that move.
    """
    id = int(front.ids[row])
    moves = [move for move in front.provenance.get(NAVIGATIONS, ()) if move["to"] == id]
    return explain(front, row, str(moves[-1]["reason"]) if moves else f"Point {id} was picked by its id.")


def compare_better(front: FrontData, row: int, *, nearest: bool) -> tuple[Comparison, ...]:
    """Return comparisons with the best point in each objective, or with the ``nearest`` better one (in shares).

    Objectives in which the point of ``row`` is itself the best are left out.
    """
    shares, others = front.shares, dict[int, list[str]]()
    distance = np.linalg.norm(shares - shares[row], axis=1)
    for axis, name in enumerate(front.names):
        better = shares[row, axis] - shares[:, axis] > OPTIONS.rounding
        if better.any():
            other = first_row(front, distance, better) if nearest else first_row(front, shares[:, axis])
            others.setdefault(other, []).append(name)
    return tuple(compare(front, row, other, names) for other, names in others.items())


def compare(front: FrontData, row: int, other: int, better_in: Sequence[str] = ()) -> Comparison:
    """Return the point of row ``other`` compared with that of ``row``."""
    gained = front.shares[row] - front.shares[other]
    amounts = np.abs(front.objectives[other] - front.objectives[row])
    gains, costs = (
        {front.names[axis]: float(amounts[axis]) for axis in np.flatnonzero(part).tolist()}
        for part in (gained > OPTIONS.rounding, gained < -OPTIONS.rounding)
    )
    return Comparison(id=int(front.ids[other]), better_in=tuple(better_in), gains=gains, costs=costs)


def exchange_rates(front: FrontData, row: int) -> tuple[ExchangeRate, ...]:
    """Return the certified exchange rates at a point, and how far they hold; none without certificates."""
    if front.certificates is None:
        return ()
    rates = np.sort(np.abs(front.certificates.exchange_intervals[row]), axis=-1)
    jumps = np.flatnonzero(np.isin(front.ids, [pair[0] for pair in front.jumps or ()]))
    on_branch = np.searchsorted(jumps, np.arange(len(front))) == np.searchsorted(jumps, row)
    shares, result = front.shares, list[ExchangeRate]()
    for i, gain in enumerate(front.names):
        # Points that gain are checked, the nearest first (in shares), until rates do not hold or the front jumps.
        better = np.flatnonzero(shares[row, i] - shares[:, i] > OPTIONS.rounding)
        distance = np.linalg.norm(shares[better] - shares[row], axis=1)
        rows = better[np.lexsort((front.ids[better], distance))]
        # Rates hold for a point if they predict its cost in each other objective j as Σ_k r_kj g_k, by the tangent
        # plane of the front; g_k: gains in all objectives but j.
        gains, holds = front.minimised[row] - front.minimised, on_branch.copy()
        for j in (j for j in range(len(front.names)) if j != i):
            others = np.delete(np.arange(len(front.names)), j)
            if not np.isfinite(rates[others, j]).all():
                rows = rows[:0]
                break
            costs = gains[:, others, None] * rates[others, j]  # (points, others, 2): by the lowest and highest rate
            low, high = costs.min(axis=2).sum(axis=1), costs.max(axis=2).sum(axis=1)
            error = np.maximum(low + gains[:, j], -gains[:, j] - high)
            holds &= error <= OPTIONS.prediction * np.abs(costs).max(axis=2).sum(axis=1)
        count = int(np.argmin(np.append(holds[rows], False)))
        last, after = rows[:count][-1:], rows[count:][:1]
        for j, cost in enumerate(front.names):
            low, high = map(float, rates[i, j])
            if i != j and np.isfinite(high):
                reach: Any = {
                    "holds_to": int(front.ids[last[0]]) if len(last) else None,
                    "holds_for": float(np.abs(front.objectives[last, i] - front.objectives[row, i]).sum()),
                    "fails_at": int(front.ids[after[0]]) if len(after) else None,
                }
                result.append(ExchangeRate(gain=gain, cost=cost, low=low, high=high, **reach))
    return tuple(result)


# The reason of a choice in words, made only from its fields.


def subject(front: FrontData, row: int) -> str:
    """Return the first words of a verdict on the point of a row."""
    return f"Point {front.ids[row]}" + (", the only one," if len(front) == 1 else f" of {len(front)}")


def percent(share: float) -> str:
    """Return a share in percent, with three digits."""
    return f"{100 * share:.3g}%"


def with_unit(front: FrontData, name: str, text: str) -> str:
    """Return ``text``, which ends with a value, and the objective's unit, if any."""
    return f"{text} {front.units[front.names.index(name)]}".rstrip()


def quantity(front: FrontData, name: str, amount: float) -> str:
    """Return an amount of an objective with its unit, with three digits."""
    return with_unit(front, name, f"{float(f'{amount:.3g}'):g}")


def named_quantity(front: FrontData, axis: int, value: float) -> str:
    """Return a value of an objective with its name and unit, with four digits."""
    return with_unit(front, front.names[axis], f"{front.names[axis]} {value:.4g}")


def list_words(words: Sequence[str], conjunction: str = "and") -> str:
    """Return words as a list in English."""
    return f" {conjunction} ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def amounts_in_words(front: FrontData, amounts: Mapping[str, float], *, better: bool, shares: bool = False) -> str:
    """Return amounts in words, such as "0.3 J more energy"; ``better``: whether they are gains."""
    words = []
    for name, amount in amounts.items():
        axis = front.names.index(name)
        direction = "more" if better == front.maximised[axis] else "less"
        part = f" ({percent(amount / np.ptp(front.ranges[axis]))} of the range)" if shares else ""
        words.append(f"{quantity(front, name, amount)} {direction} {name}{part}")
    return list_words(words)


def _trade_offs(front: FrontData, choice: Choice) -> Iterator[str]:
    """Yield three texts: a point's values, the ends of the front, and neighbours with jumps; "" for no facts."""
    # Distances from the best are given with the values if there are too many objectives for a sentence on each.
    several = len(front.names) > OPTIONS.described
    parts = []
    for axis, (share, (low, high)) in enumerate(zip(choice.shares.tolist(), front.ranges.tolist(), strict=True)):
        distance = f" ({percent(share)} of the range from the best)" * several
        note = " (the same at every point)" if low == high else distance
        parts.append(f"{named_quantity(front, axis, choice.objectives[axis])}{note}")
    values = f"It has {list_words(parts)}."
    names = {name for end in choice.ends for name in end.better_in}
    ranged = [name for name, (low, high) in zip(front.names, front.ranges, strict=True) if low < high]
    if best := [name for name in ranged if name not in names]:
        values += f" No point is better in {list_words(best, 'or')}."
    yield values

    ends = list[str]()
    if several and choice.ends:
        words = list_words([f"point {end.id} in {list_words(end.better_in)}" for end in choice.ends])
        ends.append(f"The best are {words}.")
    for end in choice.ends if not several else ():
        more = amounts_in_words(front, end.gains, better=False, shares=True)
        less = amounts_in_words(front, end.costs, better=True, shares=True)
        ends.append(f"Compared with point {end.id}, the best in {list_words(end.better_in)}, it has {more} for {less}.")
    yield " ".join(ends)

    parts = []
    for each in choice.neighbours[: OPTIONS.described]:
        gains = amounts_in_words(front, each.gains, better=True)
        costs = amounts_in_words(front, each.costs, better=False)
        parts.append(f"point {each.id} has {gains} for {costs}")
    near = [f"Its neighbour{'s' * (len(parts) > 1)}: {'; '.join(parts)}."] if parts else []
    near += [
        f"Between points {one} and {other} the front jumps to another branch of optima." for one, other in choice.jumps
    ]
    yield " ".join(near)


def _rates(front: FrontData, choice: Choice) -> Iterator[str]:
    """Yield sentences on exchange rates, or on why there are none."""
    certificates, row = front.certificates, choice.index
    if certificates is not None and not choice.rates:
        cause = str(certificates.reason[row])
        if not cause and certificates.weak[row]:
            weights = zip(front.names, certificates.weights[row], strict=True)
            weak = [name for name, weight in weights if weight < WEIGHT_TOLERANCE]
            cause = f"{list_words(weak)} has no weight, as at an end of the front"
        yield f"No exchange rate is certified here{': ' * bool(cause)}{cause}."
    gained = {name for neighbour in choice.neighbours for name in neighbour.better_in}
    for gain, group in groupby(choice.rates, key=lambda rate: rate.gain):
        if gain not in gained:  # the point is the best in this objective
            continue
        axis, rates = front.names.index(gain), list(group)
        if len(front.names) > OPTIONS.described:  # the cheapest, in shares of the ranges
            widths = dict(zip(front.names, np.ptp(front.ranges, axis=1), strict=True))
            rates = [min(rates, key=lambda rate: rate.high / max(widths[rate.cost], 1e-300))]
        costs = []
        for rate in rates:
            is_one = np.isclose(rate.low, rate.high, rtol=1e-3, atol=0)
            value = f"{rate.low:.3g}" if is_one else f"{rate.low:.3g} to {rate.high:.3g}"
            costs.append(f"{with_unit(front, rate.cost, value)} of {rate.cost}")
        verb, unit = ("gaining" if front.maximised[axis] else "saving"), front.units[axis] or "unit"
        text = f"By its certificate, {verb} {gain} costs {list_words(costs, 'or')} per {unit}"
        text += ", the others unchanged" * (len(front.names) > 2)
        reach = rates[0]
        if reach.holds_to is not None:
            away = quantity(front, gain, reach.holds_for)
            text += f"; that holds within {OPTIONS.prediction:.0%} as far as point {reach.holds_to}, {away} away"
        elif reach.fails_at is not None:
            text += f"; it is off by more than {OPTIONS.prediction:.0%} already at point {reach.fails_at}"
        yield f"{text}."
