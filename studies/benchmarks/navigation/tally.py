"""Results of moves, and their table; losses first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from studies.benchmarks.navigation.cases import Case
from studies.benchmarks.navigation.options import OPTIONS
from studies.reporting import Row


class Try(NamedTuple):
    """A peer's result for a move: its name, seconds, and the payer's value if it converged."""

    peer: str
    seconds: float
    value: float | None


@dataclass(eq=False)
class Tally:
    """Results of moves, one entry per move."""

    certified: list[bool] = field(default_factory=list)
    non_dominated: list[bool] = field(default_factory=list)
    followed: list[bool] = field(default_factory=list)
    best: list[bool] = field(default_factory=list)
    rate: list[bool] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    predicted: list[bool] = field(default_factory=list)
    prediction: list[float] = field(default_factory=list)
    missed: list[float] = field(default_factory=list)
    peer_solved: dict[str, list[bool]] = field(default_factory=dict)
    peer_seconds: dict[str, list[float]] = field(default_factory=dict)

    unreachable: int = 0
    around: int = 0

    def add_tries(self, tries: Sequence[Try]) -> None:
        """Record the peers' results for a move that some method can make."""
        for each in tries:
            self.peer_seconds.setdefault(each.peer, []).append(each.seconds)
            self.peer_solved.setdefault(each.peer, []).append(each.value is not None)


def rows_of(name: str, case: Case, tally: Tally) -> list[Row]:
    """Return the rows of a case."""
    moves = len(tally.certified)

    def row(label: str, column: str, unit: str, ours: float, reference: float | None = None, source: str = "") -> Row:
        return Row(table=name, row=label, column=column, unit=unit, ours=ours, reference=reference, source=source)

    def share(values: Sequence[bool]) -> float:
        return 100 * float(np.mean(values)) if values else np.nan

    def median(values: Sequence[float]) -> float:
        return 1e3 * float(np.median(values)) if values else np.nan

    goals = case.goals
    step = row("a step", "median", "ms CPU", median(tally.step), goals.step, "goal")
    rows = [
        row("certified", f"of {moves} moves", "%", share(tally.certified), goals.certified, "goal"),
        row("best known", f"of {moves} moves", "%", share(tally.best), goals.best, "goal"),
        row("non-dominated by the front it left", f"of {len(tally.non_dominated)}", "%", share(tally.non_dominated)),
        row("followed along its branch", f"of {len(tally.followed)}", "%", share(tally.followed)),
        row("rates within 5 % of a small move", f"of {len(tally.rate)}", "%", share(tally.rate)),
        row("out of reach for all methods", "moves", "", tally.unreachable),
        row("new points around one", f"of {OPTIONS.around}", "", tally.around),
        step,
        row("a step with its certificate", "median", "ms CPU", median(tally.whole)),
        row("predicted", f"of {len(tally.predicted)} followed", "%", share(tally.predicted)),
        row("a prediction", "median", "ms CPU", median(tally.prediction)),
        row("misses the certified point by", "median", "of a range", float(np.median(tally.missed or [np.nan]))),
    ]
    for peer, seconds in tally.peer_seconds.items():
        solved, name_only = tally.peer_solved[peer], peer.split()[0]
        rows.append(row("a step", f"beside {peer}", "ms CPU", median(tally.step), median(seconds), name_only))
        rows.append(row("converged", f"beside {peer}", "%", share(tally.certified), share(solved), name_only))
    lost = [each for each in rows if each.reference is not None and _is_lost(each, each.reference)]
    return [*lost, *(each for each in rows if each not in lost)]


def _is_lost(row: Row, reference: float) -> bool:
    """Return whether a time is longer, or a share smaller, than its reference."""
    return row.ours > reference if row.unit == "ms CPU" else row.ours < reference
