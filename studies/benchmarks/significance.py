"""Indicators of fronts against a reference, and tests of two methods' indicators over seeds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from moocore import epsilon_additive, hypervolume, igd_plus, is_nondominated
from scipy.stats import mannwhitneyu

from paretoik.arrays import Objectives, Values
from studies.reporting import Row
from studies.significance import SIGNIFICANCE, SampleComparison, compare_samples, holm, p_value

MARGIN = {"hypervolume": 0.01, "IGD+": 0.1, "epsilon": 0.1}
CORNER = 1.1  # of the hypervolume, in ranges of the union


@dataclass(frozen=True, kw_only=True)
class Comparison(SampleComparison):
    """A comparison of an indicator with a peer's; ``p_equal`` is that of a difference beyond the margin."""

    problem: str
    indicator: str
    peer: str
    p_equal: float
    p_holm: float = 1.0
    p_equal_holm: float = 1.0
    verdict: str = ""

    @property
    def tests(self) -> str:
        """The ratio with its interval, A12 and the corrected p-values, in words."""
        ratio = f"ratio {self.ratio:.3f} [{self.ratio_low:.3f}, {self.ratio_high:.3f}]"
        return f"{ratio}, A12 {self.a12:.2f}, p {self.p_holm:.1e}, p equal {self.p_equal_holm:.1e}"


def union(fronts: Sequence[Objectives]) -> Objectives:
    """Return the points of all fronts that none dominates."""
    F = np.concatenate(fronts)
    nondominated: Objectives = F[is_nondominated(F, keep_weakly=False)] if len(F) else F
    return nondominated


def scores(F: Objectives, union: Objectives) -> dict[str, float]:
    """Judge a final front against the union; an empty one counts as the corner of the hypervolume."""
    ideal, width = union.min(axis=0), np.ptp(union, axis=0)
    width = np.where(width > 0, width, 1.0)
    corner = np.full(union.shape[1], CORNER)
    normal, reference = (F - ideal) / width if len(F) else corner[None], (union - ideal) / width
    inside = normal[np.less(normal, CORNER).all(axis=1)]
    return {
        "hypervolume": float(hypervolume(inside, ref=corner)) if len(inside) else 0.0,
        "IGD+": float(igd_plus(normal, ref=reference)),
        "epsilon": float(epsilon_additive(normal, ref=reference)),
    }


def compare(problem: str, indicator: str, peer: str, ours: Values, theirs: Values) -> Comparison:
    """Test one indicator of ours against a peer's, each (seeds,); equal values prove nothing."""
    samples = compare_samples(ours, theirs, maximised=indicator == "hypervolume")
    margin = MARGIN[indicator]
    sides = (
        mannwhitneyu(ours, theirs * (1.0 - margin), alternative="greater").pvalue,
        mannwhitneyu(ours, theirs * (1.0 + margin), alternative="less").pvalue,
    )
    p_equal = p_value(np.max(sides))
    return Comparison(problem=problem, indicator=indicator, peer=peer, p_equal=p_equal, **vars(samples))


def decide(rows: Sequence[Comparison]) -> list[Comparison]:
    """Return comparisons with corrected tests and their verdicts; losses first, then undecided, equal, wins."""
    decided = []
    differing, equal = holm([row.p for row in rows]), holm([row.p_equal for row in rows])
    for row, p, p_equal in zip(rows, differing, equal, strict=True):
        verdict = "undecided"
        if p < SIGNIFICANCE.level:
            verdict = "loss" if row.a12 < 0.5 else "win"
        if p_equal < SIGNIFICANCE.level:
            verdict = f"{verdict}, within margin" if verdict != "undecided" else "equal"
        decided.append(replace(row, p_holm=float(p), p_equal_holm=float(p_equal), verdict=verdict))
    grades = ["loss", "loss, within margin", "undecided", "equal", "win, within margin", "win"]
    return sorted(decided, key=lambda row: (grades.index(row.verdict), row.indicator, row.a12))


def comparison_row(table: str, comparison: Comparison, verdict: str) -> Row:
    """Return a comparison as a row: our median and the peer's, the verdict and the tests in the note."""
    return Row(
        table=table,
        row=comparison.problem,
        column=f"{comparison.indicator} beside {comparison.peer}",
        unit="",
        ours=comparison.ours,
        reference=comparison.theirs,
        source=comparison.peer,
        note=f"{verdict}; {comparison.tests}",
    )


def tally_rows(table: str, decided: Sequence[Comparison], group: Callable[[Comparison], str]) -> list[Row]:
    """Return the numbers of wins and losses in each group of comparisons, most losses first."""
    counts: dict[str, Counter[str]] = {}
    for one in decided:
        counts.setdefault(group(one), Counter())[one.verdict.split(",")[0]] += 1
    return [
        Row(
            table=table,
            row=name,
            column="wins, and losses beside them",
            unit="",
            ours=count["win"],
            reference=count["loss"],
            source="losses",
            note=f"equal {count['equal']}, undecided {count['undecided']}",
        )
        for name, count in sorted(counts.items(), key=lambda item: item[1]["win"] - item[1]["loss"])
    ]
