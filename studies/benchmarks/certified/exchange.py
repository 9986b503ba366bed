"""Exchange rates beside central differences of neighbouring ε-solves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from paretoik.refinement.epsilon import WARM, YIELD
from paretoik.refinement.polish import polish
from studies.benchmarks.certified.cases import Known, judged
from studies.reporting import Row

STEP = 1e-4  # of the range: of the ceiling that is moved
WEIGHTY = 1e-3  # weight from which on both objectives count
AGREED = 1e-3
UNIQUE = 1e-6  # relative width of an interval that is none
TABLE_ROW = "exchange rates, differences"


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A rate ∂f_j/∂f_i, its interval, and the quotients of the solves below (backward), above and both (central)."""

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
        return bool(high - low <= UNIQUE * abs(self.rate))

    @property
    def off(self) -> float:
        """Relative difference; of an interval how far the quotients leave it."""
        if self.unique:
            return abs(self.central / self.rate - 1.0)
        low, high = self.interval
        quotients = np.array([self.backward, self.forward])
        return float(np.maximum(quotients - high, low - quotients).max(initial=0.0) / abs(self.rate))


def exchange_rows(front: Known) -> list[Row]:
    """Return how far rates are from differences, median and worst, and the same of intervals."""
    wanted = list(pairs(front))
    found = [one for one in (compared(front, *pair) for pair in wanted) if one is not None]
    rows = []
    for kind, several in (
        ("rates", [one for one in found if one.unique]),
        ("kinks", [one for one in found if not one.unique]),
    ):
        if not several:
            continue
        off = np.array([one.off for one in several])
        worst, names = several[int(off.argmax())], front.front.names
        note = (
            f"{len(several)} of {len(wanted)} pairs; worst {off.max():.1e}: ∂{names[worst.j]}/∂{names[worst.i]} at point "
            f"{worst.point}, {worst.rate:.6g} beside {worst.backward:.6g} and {worst.forward:.6g}"
        )
        column = "median relative difference" if kind == "rates" else "worst way outside the interval"
        value = float(np.median(off) if kind == "rates" else off.max())
        rows.append(judged(front.name, TABLE_ROW, column, "", value, AGREED, note))
    lost = len(wanted) - len(found)
    if lost or not wanted:
        rows.append(
            Row(
                table=front.name,
                row=TABLE_ROW,
                column="not compared",
                unit="pairs",
                ours=lost,
                note="no ε-solve converged",
            )
        )
    return rows


def pairs(front: Known) -> Iterator[tuple[int, int, int]]:
    """Return (point, i, j) where both objectives count, i no more than j: its ceiling moves far for little of j."""
    said = front.front.certificates
    assert said is not None
    for point, (weights, status) in enumerate(zip(said.weights, said.status, strict=True)):
        for i, j in permutations(range(len(weights)), 2):
            if status == "minimum" and WEIGHTY < weights[i] <= weights[j]:
                yield point, i, j


def compared(front: Known, point: int, i: int, j: int) -> Compared | None:
    """Return ∂f_j/∂f_i beside what it costs f_j to move the ceiling on f_i; None where a solve does not converge."""
    said = front.front.certificates
    assert said is not None
    count, total = len(front.ranges), len(front.program.totals)
    factors, caps = np.zeros((1, total)), np.full((3, total), np.inf)
    factors[0, :count] = YIELD
    factors[0, j] = 1.0
    caps[:, :count] = front.values[point] / front.ranges
    caps[:, j] = np.inf
    caps[:, i] += STEP * np.array([-1.0, 0.0, 1.0])
    got = polish(front.program, np.repeat(front.q[point][None], 3, axis=0), factors, caps, WARM)
    if not got.converged.all():
        return None
    signs = np.array([one.sign for one in front.task.objectives])
    low, middle, high = got.totals[:, :count] * front.ranges * signs

    def quotient(one: np.ndarray, other: np.ndarray) -> float:
        return float((other[j] - one[j]) / (other[i] - one[i]))

    return Compared(
        point=point,
        i=i,
        j=j,
        rate=float(said.exchange_rates[point, i, j]),
        interval=said.exchange_intervals[point, i, j],
        backward=quotient(low, middle),
        forward=quotient(middle, high),
        central=quotient(low, high),
    )
