"""Rows of races: a summary first, then every problem, losses first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.benchmarks.basins.racing import Race
from studies.benchmarks.planner.verdicts import losses_first, versus
from studies.reporting import Row


@dataclass(frozen=True, kw_only=True)
class Goals:
    """The goals: ours above the peers' best by at most a share ``no_worse``, on a share ``won`` of problems.

    ``time`` is our time to the best over the better peer's; ``hits`` are the shares of seeds that find the best with
    redundancy 1 and 2, and with more.
    """

    no_worse: float = 1e-7
    won: float = 58 / 60
    time: float = 0.5
    hits: tuple[float, float] = (0.95, 0.85)


GOALS = Goals()


def table_rows(races: Sequence[Race]) -> list[Row]:
    """Return the summary, then the rows of all problems, losses first."""
    return summary_rows(races) + losses_first([row for each in races for row in problem_rows(each)])


def summary_rows(races: Sequence[Race]) -> list[Row]:
    """Return the number of problems on which no peer is better, the median time ratio, and hit rates by redundancy."""
    won = sum(each.ours.best <= (1 + GOALS.no_worse) * each.peers_best for each in races)
    ratios = [each.time_ratio for each in races]
    note = f"{sum(ratio <= GOALS.time for ratio in ratios)} of {len(races)} problems within the goal"
    rows = [
        _summary("no peer better by more than 1e-7", "problems", won, np.ceil(GOALS.won * len(races)), len(races)),
        Row(table="summary", row="time to best over the better peer's", column="median", unit="", source="goal",
            ours=float(np.median(ratios)), reference=GOALS.time, note=note),
    ]  # fmt: skip
    for high, name in enumerate(("redundancy 1 and 2", "redundancy 3 and more")):
        group = [each for each in races if (each.redundancy > 2) == bool(high)]
        if group:
            hits = sum(each.ours.hits(each.best) for each in group)
            tries = sum(len(each.ours.values) for each in group)
            rows.append(
                _summary(f"seeds that find the best, {name}", "share", hits / tries, GOALS.hits[high], len(group))
            )
    return rows


def problem_rows(each: Race) -> list[Row]:
    """Return the rows of one problem: the best values, and the times to the best with every peer's."""
    table, name, best = f"redundancy {each.redundancy}", each.case.name, each.best
    rows = [
        versus(
            table=table,
            row=name,
            column="best found",
            unit=each.case.objective.unit,
            ours=each.ours.best,
            theirs=each.peers_best,
            goal=1 + GOALS.no_worse,
            note=f"ours {each.ours.hits(best)} of {len(each.ours.values)} seeds",
        )
    ]
    for peer, tries in each.peers.items():
        note = f"{peer} {tries.hits(best)} of {len(tries.values)} starts"
        times = each.ours.time_to_best(best), tries.time_to_best(best)
        rows.append(
            versus(
                table=table, row=name, column=f"time to best, {peer}", unit="s", ours=times[0], theirs=times[1],
                goal=GOALS.time, note=note,
            )
        )  # fmt: skip
    return rows


def _summary(row: str, unit: str, ours: float, goal: float, problems: int) -> Row:
    prefix = "" if ours >= goal else "LOSS: "
    return Row(
        table="summary", row=row, column="all", unit=unit, ours=float(ours), reference=float(goal), source="goal",
        note=f"{prefix}of {problems} problems",
    )  # fmt: skip
