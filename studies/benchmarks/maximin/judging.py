"""Indicators against the union of all fronts, comparisons, the cost of each method, and the goals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from studies.benchmarks.maximin.cases import POPULATION, Case
from studies.benchmarks.maximin.runs import (
    BOXED,
    CROWDING,
    HYPERVOLUME,
    ONE_LINE,
    OURS,
    Runs,
    methods_of,
)
from studies.reporting import Row
from studies.significance import (
    MARGIN,
    Comparison,
    compare,
    comparison_row,
    decide,
    scores,
    tally_rows,
    union,
)

TABLE = "{} beside its peers, medians (hypervolume: more is better; IGD+, epsilon: less)"
COUNTED = "wins and losses of {} over problems and indicators"
GOALS = "goals"
COST = "median CPU time of a run, at equal evaluations"
SHARE = 0.5  # of the problems with two objectives


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Comparisons over all runs: each of ours with every peer, losses first."""

    comparisons: dict[str, list[Comparison]]
    seconds: dict[tuple[str, str], float]  # median CPU seconds by problem and method


def judge(runs: Runs, chosen: Sequence[Case]) -> Judged:
    """Score all runs and compare each of ours with every peer, and the first with all; Holm for each of ours."""
    rows: dict[str, list[Comparison]] = {OURS: [], ONE_LINE: []}
    without = {OURS: {OURS}, ONE_LINE: {OURS, ONE_LINE, BOXED}}  # methods that each is not compared with
    for case in chosen:
        names = methods_of(case)
        joined = union([one.F for name in names for one in runs[case.name, name]])
        if not len(joined):
            print(f"{case.name}: no method found a feasible point: not judged")
            continue
        table = {name: [scores(one.F, joined) for one in runs[case.name, name]] for name in names}
        for own, peer, indicator in product(rows, names, MARGIN):
            if peer not in without[own]:
                ours, theirs = (np.array([score[indicator] for score in table[name]]) for name in (own, peer))
                rows[own].append(compare(case.name, indicator, peer, ours, theirs))
    seconds = {key: float(np.median([one.seconds for one in each])) for key, each in runs.items()}
    return Judged(comparisons={own: decide(each) for own, each in rows.items()}, seconds=seconds)


def comparison_rows(judged: Judged) -> list[Row]:
    """Return all comparisons, a table for each of ours, and their count by peer."""
    tables, tallies = list[Row](), list[Row]()
    for own, decided in judged.comparisons.items():
        tables += [comparison_row(TABLE.format(own), one, one.verdict) for one in decided]
        tallies += tally_rows(COUNTED.format(own), decided, lambda one: one.peer)
    return [*tables, *tallies]


def goal_rows(judged: Judged, chosen: Sequence[Case]) -> list[Row]:
    """Return the goals for each of ours against their peers that ran, and whether they are met."""
    return [
        row
        for method in judged.comparisons
        for row in (*_never_behind(judged, method), *_ahead_in_time(judged, method, chosen))
    ]


def _never_behind(judged: Judged, method: str) -> list[Row]:
    """No significant loss to crowding on any problem, in any indicator."""
    comparisons = [one for one in judged.comparisons[method] if one.peer == CROWDING]
    if not comparisons:
        return []
    losses = [one for one in comparisons if one.verdict.startswith("loss")]
    won, undecided = (sum(one.verdict.startswith(word) for one in comparisons) for word in ("win", "undecided"))
    note = f"of {len(comparisons)} comparisons {won} won, {undecided} undecided"
    note += "".join(f"; {one.problem} {one.indicator}: {one.verdict}" for one in losses)
    verdict = "NOT MET" if losses else "met" if undecided < len(comparisons) else "UNDECIDED"  # by too few seeds
    return [_goal(method, f"significant losses to {CROWDING}", len(losses), 0, f"{verdict}: {note}")]


def _ahead_in_time(judged: Judged, method: str, chosen: Sequence[Case]) -> list[Row]:
    """Ahead in median hypervolume on at least half of the problems with two objectives, in no more time."""
    names = {case.name for case in chosen if case.n_obj == 2}
    comparisons = [
        one
        for one in judged.comparisons[method]
        if one.peer == HYPERVOLUME and one.indicator == "hypervolume" and one.problem in names
    ]
    if not comparisons:
        return []
    times = [judged.seconds[one.problem, method] / judged.seconds[one.problem, HYPERVOLUME] for one in comparisons]
    ahead = [one.ours > one.theirs and ratio <= 1.0 for one, ratio in zip(comparisons, times, strict=True)]
    wins, losses = (sum(one.verdict.startswith(word) for one in comparisons) for word in ("win", "loss"))
    share = float(np.mean(ahead))
    note = f"{'met' if share >= SHARE else 'NOT MET'}: {sum(ahead)} of {len(ahead)}"
    note += f"; significantly ahead in {wins}, behind in {losses}"
    note += f"; {min(times):.2f} to {max(times):.2f} of its time, median {np.median(times):.2f}"
    what = f"share of two-objective problems ahead of {HYPERVOLUME} in hypervolume at no more time"
    return [_goal(method, what, share, SHARE, note)]


def _goal(method: str, what: str, ours: float, goal: float, note: str) -> Row:
    return Row(GOALS, method, what, "", ours, reference=goal, source="goal", note=note)


def cost_rows(judged: Judged, chosen: Sequence[Case]) -> list[Row]:
    """Return the cost of every method on every case."""
    rows = []
    for case in chosen:
        note = f"{POPULATION[case.n_obj] * case.generations} evaluations"
        rows += [
            Row(COST, case.name, name, "s", judged.seconds[case.name, name], note=note) for name in methods_of(case)
        ]
    return rows
