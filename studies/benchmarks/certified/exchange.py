"""Exchange rates compared with central differences of neighbouring ε-solves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Solutions
from paretoik.pareto.sweep import OPTIONS as EPSILON
from paretoik.trajectory.motion_terms import joint_distance
from studies.benchmarks.certified.cases import Subject, goal_row
from studies.reporting import Row

STEPS = (1e-4, 1e-5, 1e-6)  # share of the moved ceiling's range: the first whose solves stay near is used
STAY = 0.05  # rad, m: a solve that ends farther off has gone to another valley
WEIGHTY = 1e-3  # least weight with which both objectives count
AGREED = 1e-3
UNIQUE = 1e-6  # relative width below which an interval is a rate
TABLE_ROW = "exchange rates, differences"


@dataclass(frozen=True, kw_only=True)
class RateComparison:
    """A rate ∂f_j/∂f_i, NaN if it is not unique, its interval, and the quotients of neighbouring solves.

    The quotients use the solves below (backward), above (forward) and both (central).
    """

    point: int
    i: int
    j: int
    rate: float
    interval: np.ndarray
    backward: float
    forward: float
    central: float

    @property
    def unique(self) -> bool:
        """Whether multipliers are."""
        low, high = self.interval
        return bool(high - low <= UNIQUE * abs(high))

    @property
    def off(self) -> float:
        """Relative difference; for an interval, how far the quotients are outside it."""
        if self.unique:
            return abs(self.central / self.rate - 1.0)
        low, high = self.interval
        quotients = np.array([self.backward, self.forward])
        size = abs(self.rate) if np.isfinite(self.rate) else max(abs(low), abs(high))
        return float(np.maximum(quotients - high, low - quotients).max(initial=0.0) / size)


def exchange_rows(subject: Subject) -> list[Row]:
    """Return the difference of rates from quotients, median and worst, and the same for intervals."""
    tried = list(pairs(subject))
    comparisons = [one for one in (compare_rate(subject, *pair) for pair in tried) if one is not None]
    rows = []
    for kind, several in (
        ("rates", [one for one in comparisons if one.unique]),
        ("kinks", [one for one in comparisons if not one.unique]),
    ):
        if not several:
            continue
        off = np.array([one.off for one in several])
        worst, names = several[int(off.argmax())], subject.front.names
        note = (
            f"{len(several)} of {len(tried)} pairs; worst {off.max():.1e}: ∂{names[worst.j]}/∂{names[worst.i]} at "
            f"point {worst.point}, {worst.rate:.6g} against {worst.backward:.6g} and {worst.forward:.6g}"
        )
        column = "median relative difference" if kind == "rates" else "worst way outside the interval"
        value = float(np.median(off) if kind == "rates" else off.max())
        rows.append(goal_row(subject.name, TABLE_ROW, column, "", value, AGREED, note))
    missing = len(tried) - len(comparisons)
    if missing or not tried:
        rows.append(
            Row(
                table=subject.name,
                row=TABLE_ROW,
                column="not compared",
                unit="pairs",
                ours=missing,
                note="no ε-solves that stay near" if tried else "no point where two objectives count",
            )
        )
    return rows


def pairs(subject: Subject) -> Iterator[tuple[int, int, int]]:
    """Return (point, i, j) if both objectives count, i no more than j: its ceiling moves far for little of j."""
    for point, (weights, status) in enumerate(
        zip(subject.certificates.weights, subject.certificates.status, strict=True)
    ):
        for i, j in permutations(range(len(weights)), 2):
            if status == "minimum" and WEIGHTY < weights[i] <= weights[j]:
                yield point, i, j


def compare_rate(subject: Subject, point: int, i: int, j: int) -> RateComparison | None:
    """Return ∂f_j/∂f_i and the quotient of f_j by the ceiling on f_i; None if no step's solves stay near.

    Further objectives stay below the point's own values. An objective of little weight would be held from one side
    only: it is added to f_j instead, with its own weight, which does not change the rate.
    """
    weights, count, total = subject.certificates.weights[point], len(subject.ranges), len(subject.program.totals)
    added = (weights <= WEIGHTY) | (np.arange(count) == j)
    factors, caps = np.zeros((1, total)), np.full((3, total), np.inf)
    factors[0, :count] = np.where(added, weights / weights[j], 0.0)
    caps[:, :count] = np.where(added, np.inf, subject.values[point] / subject.ranges)
    got = _neighbouring_solves(subject, point, i, factors, caps)
    if got is None:
        return None
    signs = np.array([one.sign for one in subject.task.objectives])
    natural = (subject.ranges * signs)[[i, j]]
    low, middle, high = np.stack([got.objectives[:, i], got.objectives @ factors[0]], axis=1) * natural

    def quotient(one: np.ndarray, other: np.ndarray) -> float:
        return float((other[1] - one[1]) / (other[0] - one[0]))

    return RateComparison(
        point=point,
        i=i,
        j=j,
        rate=float(subject.certificates.exchange_rates[point, i, j]),
        interval=subject.certificates.exchange_intervals[point, i, j],
        backward=quotient(low, middle),
        forward=quotient(middle, high),
        central=quotient(low, high),
    )


def _neighbouring_solves(
    subject: Subject, point: int, i: int, factors: np.ndarray, caps: np.ndarray
) -> Solutions | None:
    """Return the solves below, at and above the ceiling on f_i in the point's own valley."""
    q = subject.q[point]
    for step in STEPS:
        upper = caps.copy()
        upper[:, i] += step * np.array([-1.0, 0.0, 1.0])
        solutions = minimise(subject.program, np.repeat(q[None], 3, axis=0), factors, upper, EPSILON.near)
        if solutions.converged.all() and joint_distance(subject.task, q, solutions.x).max() <= STAY:
            return solutions
    return None
