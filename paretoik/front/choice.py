"""A chosen point with what explains it, and the protocol of preferences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Mask, Values
from paretoik.errors import InvalidInput
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.inputs import check_call, check_mapping, shown
from paretoik.tables import field_representation, fit_screen, html_representation

if TYPE_CHECKING:
    from paretoik.front.front import Front

# Numbers by objective, as preferences take them: a mapping, keywords, or both.


def named_numbers(
    kind: str,
    mapping: Mapping[str, float] | None,
    keywords: Mapping[str, float],
    *,
    accept: Callable[[float], bool] = np.isfinite,
    requirement: str = "a finite number",
) -> Mapping[str, float]:
    """Return numbers by objective, read-only; raises InvalidInput for what is none, and names that come twice."""
    if mapping is not None:
        check_mapping(kind, mapping, "numbers by objective", example="{'energy': 0.3}")
    merged = dict(mapping or {})
    twice = sorted(merged.keys() & keywords.keys())
    if twice:
        raise InvalidInput(f"{kind}: wanted each objective once, got {twice[0]} twice")
    merged.update(keywords)
    for name, value in merged.items():
        if not _is_number(value) or not accept(float(value)):
            raise InvalidInput(f"{kind}: wanted {requirement} for {name}, got {shown(value)}")
    return MappingProxyType({name: float(value) for name, value in merged.items()})


def named_text(numbers: Mapping[str, float]) -> str:
    """Return numbers by objective as they are written in Python."""
    identifiers = all(name.isidentifier() for name in numbers)
    return ", ".join(f"{name}={value:g}" for name, value in numbers.items()) if identifiers else str(dict(numbers))


def _is_number(value: object) -> bool:
    try:
        return not isinstance(value, bool) and isinstance(value, Real) and not np.isnan(float(value))
    except OverflowError:
        return False


# Which point comes first where several score alike: the one rule of all preferences.


def first_row(front: Front, scores: Values, among: Mask | None = None) -> int:
    """Return the row with the least of ``scores`` (points,), in shares of the ranges; of several the first.

    Scores within rounding of the least are equal. Then comes the point with the lowest sum of shares ΣZ, of equal
    sums (within the same) the one with the better first objective, then the second and so on, then the lowest id.
    ``among`` marks the rows that are looked at, at least one; all if None.
    """
    rows = np.arange(len(front)) if among is None else np.flatnonzero(among)
    for values in (scores, front.shares.sum(axis=1)):
        rows = rows[values[rows] <= values[rows].min() + OPTIONS.rounding]
    order = np.lexsort((front.ids[rows], *front.minimised[rows].T[::-1]))
    return int(rows[order[0]])


# Where a move along a front is expected to lead.


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """The objectives (n_obj,) that a move is expected to lead to, in the user's own sign, and the motion that has them.

    It is no point of the front: it has no id and no certificate. ``motion`` is None where the front has none.
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


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Another point beside the chosen one: by how much it is better and worse, by objective, in natural units.

    ``better_in`` names the objectives that it stands for: those it is the best of all points in, or, of a neighbour,
    those that it is the nearest point to gain in. All amounts are positive.
    """

    id: int
    better_in: tuple[str, ...]
    gains: Mapping[str, float]
    costs: Mapping[str, float]

    __repr__ = field_representation
    _repr_html_ = html_representation


@dataclass(frozen=True, kw_only=True)
class ExchangeRate:
    """What one unit of ``gain`` costs of ``cost`` at the chosen point, the other objectives unchanged.

    ``low`` to ``high`` in the units of ``cost`` per unit of ``gain``, from the certificate. The rates that gain the
    same objective hold within a tenth as far as point ``holds_to``, which gains ``holds_for``; ``fails_at`` is the next
    point, where they do not any more. None where there is no such point, or rates are missing.
    """

    gain: str
    cost: str
    low: float
    high: float
    holds_to: int | None = None
    holds_for: float = 0.0
    fails_at: int | None = None

    __repr__ = field_representation
    _repr_html_ = html_representation


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One point of a front: its ``id``, its row ``index``, its motion and objectives, and the ``reason`` of the choice.

    The reason is made from the other fields. ``verdict`` is what the preference says, ``preference`` itself, ``score``
    what it makes least (None where it has no such number) and ``details`` its further numbers, by name. ``shares`` say
    how far each objective is from the best of its stored range, as a share of it. ``ends`` are the best points of the
    single objectives, ``neighbours`` for each objective the nearest point (in shares) that gains in it, ``rates`` the
    certified exchange rates, ``jumps`` the pairs of ids beside it between which the front jumps to another branch.
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
        return fit_screen(f"Choice of point {self.id}: {self.reason}")

    _repr_html_ = html_representation


@runtime_checkable
class Preference(Protocol):
    """A preference, which chooses one point of a front that has at least one; write your own like this.

    ``choose`` returns ``front.choice(row, verdict)``: the row of the point, and a sentence that says why. What the
    choice gains and costs beside other points is added by the front. Measure on ``front.shares``, which come from the
    stored ranges, so that more points do not move the choice; in ``front.minimised`` less is better of every objective.

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


def is_preference(value: object) -> TypeGuard[Preference]:
    """Say whether a value can choose a point; a class cannot, nor an array, whose ``choose`` is another one."""
    return callable(getattr(type(value), "choose", None)) and not isinstance(value, type | np.ndarray)


def check_preference(name: str, value: object) -> None:
    """Raise InvalidInput, by ``name``, unless a value is a preference or None."""
    if value is not None and not is_preference(value):
        raise InvalidInput(f"{name}: a preference wanted, such as Weights(...), got {shown(value)}")


# What explains a chosen point: the ends of the front, its neighbours, its exchange rates and how far they hold.


def compare_ends(front: Front, row: int) -> tuple[Comparison, ...]:
    """Return the best points of the single objectives beside the point of a row; none where it is the best itself."""
    shares, best = front.shares, dict[int, list[str]]()
    for axis, name in enumerate(front.names):
        if shares[row, axis] > shares[:, axis].min() + OPTIONS.rounding:
            best.setdefault(first_row(front, shares[:, axis]), []).append(name)
    return tuple(compare(front, row, other, names) for other, names in best.items())


def compare_neighbours(front: Front, row: int) -> tuple[Comparison, ...]:
    """Return for each objective the nearest point, in shares, that is better in it."""
    shares, nearest = front.shares, dict[int, list[str]]()
    distance = np.linalg.norm(shares - shares[row], axis=1)
    for axis, name in enumerate(front.names):
        better = shares[row, axis] - shares[:, axis] > OPTIONS.rounding
        if better.any():
            nearest.setdefault(first_row(front, distance, better), []).append(name)
    return tuple(compare(front, row, other, names) for other, names in nearest.items())


def jumps_beside(front: Front, row: int) -> tuple[tuple[int, int], ...]:
    """Return the jumps of the front that begin or end at the point of a row."""
    return tuple(pair for pair in front.jumps or () if int(front.ids[row]) in pair)


def exchange_rates(front: Front, row: int) -> tuple[ExchangeRate, ...]:
    """Return the certified exchange rates at the point of a row, and how far they hold; none without certificates."""
    if front.certificates is None:
        return ()
    rates = np.sort(np.abs(front.certificates.exchange_intervals[row]), axis=-1)
    result = []
    for i, gain in enumerate(front.names):
        reach = _reach(front, row, i, rates)
        for j, cost in enumerate(front.names):
            low, high = map(float, rates[i, j])
            if i != j and np.isfinite(high):
                result.append(replace(reach, gain=gain, cost=cost, low=low, high=high))
    return tuple(result)


def compare(front: Front, row: int, other: int, better_in: Sequence[str] = ()) -> Comparison:
    """Return the point of a row ``other`` beside that of a ``row``."""
    gained = front.shares[row] - front.shares[other]
    amounts = np.abs(front.objectives[other] - front.objectives[row])
    gains, costs = (
        {front.names[axis]: float(amounts[axis]) for axis in np.flatnonzero(part).tolist()}
        for part in (gained > OPTIONS.rounding, gained < -OPTIONS.rounding)
    )
    return Comparison(id=int(front.ids[other]), better_in=tuple(better_in), gains=gains, costs=costs)


def _reach(front: Front, row: int, axis: int, rates: Float[np.ndarray, "n_obj n_obj 2"]) -> ExchangeRate:
    """Return, as a rate without its value, how far all rates hold that gain an objective.

    Points that gain in it are looked at from the nearest on, in shares, until rates do not hold or the front jumps.
    """
    shares = front.shares
    better = np.flatnonzero(shares[row, axis] - shares[:, axis] > OPTIONS.rounding)
    distance = np.linalg.norm(shares[better] - shares[row], axis=1)
    rows = better[np.lexsort((front.ids[better], distance))]
    holds = _holds(front, row, axis, rates)
    unknown = ExchangeRate(gain="", cost="", low=np.nan, high=np.nan)
    if holds is None or not len(rows):
        return unknown
    count = int(np.argmin(np.append(holds[rows] & ~_beyond_jump(front, row)[rows], False)))
    last, after = rows[:count][-1:], rows[count:][:1]
    gained = np.abs(front.objectives[last, axis] - front.objectives[row, axis])
    return replace(
        unknown,
        holds_to=int(front.ids[last[0]]) if len(last) else None,
        holds_for=float(gained.sum()),
        fails_at=int(front.ids[after[0]]) if len(after) else None,
    )


def _holds(front: Front, row: int, axis: int, rates: Float[np.ndarray, "n_obj n_obj 2"]) -> Mask | None:
    """Say for every point whether rates predict the costs of going there from ``row``; None where rates are missing.

    The cost in objective j is Σ_k r_kj g_k over the gains g_k of all others: the tangent plane of the front.
    """
    gains = front.minimised[row] - front.minimised
    holds = np.ones(len(front), dtype=bool)
    for j in (j for j in range(len(front.names)) if j != axis):
        others = np.delete(np.arange(len(front.names)), j)
        if not np.isfinite(rates[others, j]).all():
            return None
        costs = gains[:, others, None] * rates[others, j]  # (points, others, 2): by the lowest and the highest rate
        error = np.maximum(costs.min(axis=2).sum(axis=1) + gains[:, j], -gains[:, j] - costs.max(axis=2).sum(axis=1))
        holds &= error <= OPTIONS.prediction * np.abs(costs).max(axis=2).sum(axis=1)
    return holds


def _beyond_jump(front: Front, row: int) -> Mask:
    """Mark the points that a jump lies before on the way from the point of a row; none where jumps are unknown."""
    starts: Int[np.ndarray, " jumps"] = np.flatnonzero(np.isin(front.ids, [pair[0] for pair in front.jumps or ()]))
    crossed: Values = np.searchsorted(starts, np.arange(len(front))) - np.searchsorted(starts, row)
    return np.asarray(crossed != 0)


# The reason of a choice in plain sentences, made from its fields alone.


def subject(front: Front, row: int) -> str:
    """Return the words that a verdict on the point of a row begins with."""
    if len(front) == 1:
        return f"Point {front.ids[row]}, the only one,"
    return f"Of {len(front)} points point {front.ids[row]}"


def percent(share: float) -> str:
    """Return a share in percent, with three digits."""
    return f"{100 * share:.3g}%"


def quantity(front: Front, name: str, amount: float) -> str:
    """Return an amount of an objective with its unit, with three digits."""
    return f"{float(f'{amount:.3g}'):g} {front.units[front.names.index(name)]}".rstrip()


def list_words(words: Sequence[str], conjunction: str = "and") -> str:
    """Return words as a list in English."""
    return f" {conjunction} ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def explain(
    front: Front, row: int, verdict: str, *, preference: Any, score: float | None, details: Mapping[str, Any]
) -> Choice:
    """Return the point of a row as a choice that explains itself."""
    choice = Choice(
        id=int(front.ids[row]),
        index=row,
        objectives=front.objectives[row],
        motion=None if front.motions is None else front.motions[row],
        reason="",
        verdict=verdict,
        preference=preference,
        score=score,
        details=MappingProxyType(dict(details)),
        shares=front.shares[row],
        ends=compare_ends(front, row),
        neighbours=compare_neighbours(front, row),
        rates=exchange_rates(front, row),
        jumps=jumps_beside(front, row),
    )
    return replace(choice, reason=_reason(front, choice))


def _reason(front: Front, choice: Choice) -> str:
    """Return why a point was chosen, where it stands, what it gives up for what, and how far its rates hold."""
    if len(front) == 1:
        return choice.verdict
    sentences = [choice.verdict, _place(front, choice), *_ends(front, choice), *_neighbours(front, choice)]
    return " ".join(filter(None, [*sentences, *_jumps(choice), *_rates(front, choice)]))


def _place(front: Front, choice: Choice) -> str:
    """Return the objectives' values, and how far from the best they are where no sentence on the ends says so."""
    parts = []
    for axis, (share, (low, high)) in enumerate(zip(choice.shares.tolist(), front.ranges.tolist(), strict=True)):
        note = " (the same at every point)" if low == high else ""
        if low < high and len(front.names) > OPTIONS.described:
            note = f" ({percent(share)} of the range from the best)"
        parts.append(f"{front.quantity(axis, choice.objectives[axis])}{note}")
    return f"It has {list_words(parts)}."


def _ends(front: Front, choice: Choice) -> Iterator[str]:
    names = {name for end in choice.ends for name in end.better_in}
    best = [
        name for name, (low, high) in zip(front.names, front.ranges, strict=True) if low < high and name not in names
    ]
    if best:
        yield f"No point is better in {list_words(best, 'or')}."
    if len(front.names) > OPTIONS.described:
        parts = [f"point {end.id} in {list_words(end.better_in)}" for end in choice.ends]
        yield f"The best are {list_words(parts)}." if parts else ""
        return
    for end in choice.ends:
        more, less = (
            amounts_in_words(front, end.gains, better=False, shares=True),
            amounts_in_words(front, end.costs, better=True, shares=True),
        )
        yield f"Beside point {end.id}, the best in {list_words(end.better_in)}, it has {more} for {less}."


def _neighbours(front: Front, choice: Choice) -> Iterator[str]:
    parts = []
    for each in choice.neighbours[: OPTIONS.described]:
        gains, costs = (amounts_in_words(front, part, better=part is each.gains) for part in (each.gains, each.costs))
        parts.append(f"point {each.id} has {gains} for {costs}")
    if parts:
        yield f"Its neighbour{'s' * (len(parts) > 1)}: {'; '.join(parts)}."


def amounts_in_words(front: Front, amounts: Mapping[str, float], *, better: bool, shares: bool = False) -> str:
    """Return amounts by objective as more or less of each, whichever is the better or the worse of it."""
    words = []
    for name, amount in amounts.items():
        axis = front.names.index(name)
        direction = "more" if better == front.maximised[axis] else "less"
        part = f" ({percent(amount / np.ptp(front.ranges[axis]))} of the range)" if shares else ""
        words.append(f"{quantity(front, name, amount)} {direction} {name}{part}")
    return list_words(words)


def _jumps(choice: Choice) -> Iterator[str]:
    for one, other in choice.jumps:
        yield f"Between points {one} and {other} the front jumps to another branch of optima."


def _rates(front: Front, choice: Choice) -> Iterator[str]:
    certificates, row = front.certificates, choice.index
    if certificates is None:
        return
    if not choice.rates:
        cause = str(certificates.reason[row])
        if not cause and certificates.weak[row]:
            weak = [name for name, weight in zip(front.names, certificates.weights[row], strict=True) if weight < 1e-6]
            cause = f"{list_words(weak)} has no weight, as at an end of the front"
        yield f"No exchange rate is certified here{': ' * bool(cause)}{cause}."
        return
    gained = {name for neighbour in choice.neighbours for name in neighbour.better_in}
    for gain, rates in groupby(choice.rates, key=lambda rate: rate.gain):
        if gain in gained:  # beyond the best point there is nothing to buy
            yield _rate_sentence(front, gain, list(rates))


def _rate_sentence(front: Front, gain: str, rates: list[ExchangeRate]) -> str:
    axis = front.names.index(gain)
    if len(front.names) > OPTIONS.described:  # the cheapest, in shares of the ranges
        rates = [
            min(rates, key=lambda rate: rate.high / max(np.ptp(front.ranges[front.names.index(rate.cost)]), 1e-300))
        ]
    costs = []
    for rate in rates:
        value = (
            f"{rate.low:.3g}"
            if np.isclose(rate.low, rate.high, rtol=1e-3, atol=0)
            else f"{rate.low:.3g} to {rate.high:.3g}"
        )
        costs.append(f"{value} {front.units[front.names.index(rate.cost)]}".rstrip() + f" of {rate.cost}")
    verb, unit = ("gaining" if front.maximised[axis] else "saving"), front.units[axis] or "unit"
    condition = ", the others unchanged" if len(front.names) > 2 else ""
    price = f"By its certificate {verb} {gain} costs {list_words(costs, 'or')} per {unit}{condition}"
    return f"{price}{_validity(front, rates[0])}."


def _validity(front: Front, rate: ExchangeRate) -> str:
    if rate.holds_to is not None:
        amount = quantity(front, rate.gain, rate.holds_for)
        return f"; that holds within {OPTIONS.prediction:.0%} as far as point {rate.holds_to}, {amount} away"
    return (
        ""
        if rate.fails_at is None
        else f"; at point {rate.fails_at} already it is off by more than {OPTIONS.prediction:.0%}"
    )
