"""What explains a chosen point: the ends of the front, its neighbours, its exchange rates and how far they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Mask, Values
from paretoik.front.choice import Comparison, ExchangeRate
from paretoik.front.preference_options import OPTIONS
from paretoik.front.ties import first_row

if TYPE_CHECKING:  # a front asks this file to explain its choices
    from paretoik.front.front import Front


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
