"""The reason of a choice in plain sentences, made from its fields alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from paretoik.front.choice import Choice, ExchangeRate
from paretoik.front.explanation import (
    compare_ends,
    compare_neighbours,
    exchange_rates,
    jumps_beside,
)
from paretoik.front.preference_options import OPTIONS

if TYPE_CHECKING:  # a front asks this file for words
    from paretoik.front.front import Front


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
