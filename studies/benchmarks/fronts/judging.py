"""Indicators against the union of all fronts, comparisons with peers, and the effect of each factor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from paretoik.arrays import Objectives, Values
from studies.benchmarks.fronts.cases import Run
from studies.benchmarks.fronts.methods import CELLS, FACTORS, OURS, PLAIN
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.benchmarks.significance import MARGIN, Comparison, compare, comparison_row, decide, scores, tally_rows
from studies.reporting import Row
from studies.significance import bootstrap_interval

HURTS, UNDECIDED, HELPS = ("HURTS", "overlap"), "undecided", ("helps", "add to each other")  # of one factor, of several
COMPARED, ADDED, COUNTED, LEFT = (
    "our fronts beside the peers', medians (hypervolume: more is better; IGD+, epsilon: less)",
    "what each factor adds (positive: better), in the indicator's unit, with 95 % bootstrap interval",
    "wins and losses over problems and indicators",
    "what every method left: median normalised hypervolume, and what it spent",
)

Scores = Mapping[str, Sequence[dict[str, float]]]  # of every seed, by method


@dataclass(frozen=True, kw_only=True)
class Effect:
    """The gain in an indicator by factors (their product, if several), with its bootstrap interval."""

    case: str
    factors: str
    indicator: str
    mean: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """The side of zero that the whole interval is on; one seed gives none."""
        if not (self.low > 0.0 or self.high < 0.0):
            return UNDECIDED
        return (HELPS if self.low > 0 else HURTS)[" × " in self.factors]


def all_scores(runs: Mapping[str, Sequence[Run]], reference: Objectives) -> dict[str, list[dict[str, float]]]:
    """Return the indicators of every run by method."""
    return {name: [scores(run.F, reference) for run in each] for name, each in runs.items()}


def comparisons(case: str, kind: str, scores: Scores) -> list[Comparison]:
    """Compare each of our methods with every peer, not yet corrected for their number."""
    mine = (OURS, PLAIN, EPSILON)
    peers = [name for name in scores if name not in (*CELLS, *mine)]
    rows = []
    for method in mine:
        for peer, indicator in product(peers, MARGIN):
            sides = [np.array([score[indicator] for score in scores[name]]) for name in (method, peer)]
            rows.append(compare(f"{case}, equal {kind}", indicator, f"{peer}: {method}", *sides))
    return rows


def effects(case: str, scores: Scores) -> list[Effect]:
    """Return main effects on all indicators and interactions on hypervolume, seeds as blocks."""
    chosen = [(k,) for k in range(3)]
    rows = []
    for indicator in MARGIN:
        better = 1.0 if indicator == "hypervolume" else -1.0
        both = [*combinations(range(3), 2), (0, 1, 2)] if indicator == "hypervolume" else []
        table = np.array([[score[indicator] for score in scores[name]] for name in CELLS]) * better
        for which in [*chosen, *both]:
            mean, low, high = effect(table, contrast(which))
            name = " × ".join(FACTORS[k] for k in which)
            rows.append(Effect(case=case, factors=name, indicator=indicator, mean=mean, low=low, high=high))
    return rows


def contrast(which: Sequence[int]) -> Values:
    """Return the weights (8,) of the cells whose sum is an effect: half of them positive, halves adding up to ±1."""
    levels = np.array([(cell.maximin, cell.seeded, cell.refined) for cell in CELLS.values()])
    signs: Values = np.prod(np.where(levels[:, list(which)], 1.0, -1.0), axis=1)
    return signs / 4


def effect(table: Values, weights: Values) -> tuple[float, float, float]:
    """Return the mean over seeds of a contrast of cells (8, seeds), and its 95 % bootstrap interval."""
    each = weights @ table
    return float(each.mean()), *bootstrap_interval(np.mean, each)


def comparison_rows(every: Sequence[Comparison]) -> list[Row]:
    """Return comparisons, losses first, after Holm over all of them, and their count by peer."""
    grades = ["loss", "undecided", "equal", "win"]
    decided = sorted(decide(every), key=lambda one: (grades.index(one.verdict.split(",")[0]), one.a12))
    rows = [
        comparison_row(COMPARED, one, one.verdict.upper() if one.verdict.startswith("loss") else one.verdict)
        for one in decided
    ]
    return [*rows, *tally_rows(COUNTED, decided, lambda one: f"{one.peer}, {one.problem.split(', ')[-1]}")]


def effect_rows(every: Sequence[Effect]) -> list[Row]:
    """Return effects, negative ones first."""
    grades = [HURTS[0], HURTS[1], UNDECIDED, HELPS[1], HELPS[0]]
    return [
        Row(
            table=ADDED,
            row=one.case,
            column=f"{one.factors}, {one.indicator}",
            unit="",
            ours=one.mean,
            note=f"{one.verdict} [{one.low:.4f}, {one.high:.4f}]",
        )
        for one in sorted(every, key=lambda one: grades.index(one.verdict))
    ]


def left_rows(case: str, kind: str, runs: Mapping[str, Sequence[Run]], scores: Scores) -> list[Row]:
    """Return the results and costs of every method, cells included."""
    rows = []
    for name, each in runs.items():
        volume = float(np.median([score["hypervolume"] for score in scores[name]]))
        middle = {
            what: np.median([getattr(run, what) for run in each]) for what in ("evaluations", "iterations", "seconds")
        }
        points = np.median([len(run.F) for run in each])
        note = (
            f"{points:.0f} points, {sum(run.failed for run in each)} failed the verifier in all, "
            f"{sum(not len(run.F) for run in each)} of {len(each)} runs empty; "
            f"{middle['evaluations']:.0f} evaluations, {middle['iterations']:.0f} iterations, "
            f"{middle['seconds']:.2f} s CPU"
        )
        rows.append(Row(table=LEFT, row=f"{case}, equal {kind}", column=name, unit="", ours=volume, note=note))
    return sorted(rows, key=lambda row: -row.ours)
