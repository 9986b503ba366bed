"""Indicators of fronts, tests of two methods over seeds, p-values of several tests, and bootstrap intervals."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from moocore import epsilon_additive, hypervolume, igd_plus, is_nondominated
from scipy.stats import DegenerateDataWarning, bootstrap, mannwhitneyu

from paretoik.arrays import Objectives, Values
from studies.reporting import Row

LEVEL, CONFIDENCE, RESAMPLES = 0.05, 0.95, 2000  # level of tests; confidence and resamples of intervals


@dataclass(frozen=True, kw_only=True)
class SampleComparison:
    """Medians of two methods over seeds, their ``ratio`` with its bootstrap interval, and a Mann-Whitney test.

    ``a12`` is the probability that a value of ours is better than one of theirs, ties counted half (Vargha & Delaney
    2000); ``p`` is the p-value of no difference, not corrected for the number of tests.
    """

    ours: float
    theirs: float
    ratio: float
    ratio_low: float
    ratio_high: float
    a12: float
    p: float


def compare_samples(ours: Values, theirs: Values, *, maximised: bool) -> SampleComparison:
    """Compare values (seeds,) of ours with a peer's; large ones are better if ``maximised``."""
    sign = 1.0 if maximised else -1.0
    test = mannwhitneyu(sign * ours, sign * theirs)
    low, high = bootstrap_interval(_ratio_of_medians, ours, theirs)
    return SampleComparison(
        ours=float(np.median(ours)),
        theirs=float(np.median(theirs)),
        ratio=float(_ratio_of_medians(ours, theirs)),
        ratio_low=low,
        ratio_high=high,
        a12=float(test.statistic) / len(ours) / len(theirs),
        p=p_value(test.pvalue),
    )


def p_value(p: float) -> float:
    """Return a p-value; 1 for NaN, the result of a test on equal values."""
    return 1.0 if np.isnan(p) else float(p)


def _ratio_of_medians(ours: np.ndarray, theirs: np.ndarray, axis: int = -1) -> Values:
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: Values = np.divide(np.median(ours, axis=axis), np.median(theirs, axis=axis))
    return ratio


def bootstrap_interval(statistic: Callable[..., Values], *samples: Values) -> tuple[float, float]:
    """Return the percentile interval of a ``statistic(*samples, axis=)`` of independent samples.

    The bias-corrected interval (BCa) is not used: its jackknife fails for medians (Efron & Tibshirani 1993, chapter
    11), and it does not exist for equal values. The interval is NaN if a sample has fewer than two values, or if the
    statistic of a resample is not finite.
    """
    if min(map(len, samples)) < 2:
        return float("nan"), float("nan")
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateDataWarning)  # about a NaN, which is returned
        result = bootstrap(
            samples, statistic, method="percentile", n_resamples=RESAMPLES, confidence_level=CONFIDENCE, rng=0
        )
    if not np.isfinite(result.bootstrap_distribution).all():
        return float("nan"), float("nan")
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def holm(p: Sequence[float]) -> np.ndarray:
    """Return p-values of several tests, corrected for their number. Source: Holm 1979."""
    corrected, highest = np.empty(len(p)), 0.0
    for place, index in enumerate(np.argsort(p)):
        highest = max(highest, min(1.0, p[index] * (len(p) - place)))
        corrected[index] = highest
    return corrected


MARGIN = {"hypervolume": 0.01, "IGD+": 0.1, "epsilon": 0.1}
CORNER = 1.1  # reference point of the hypervolume, in ranges of the union


@dataclass(frozen=True, kw_only=True)
class Comparison(SampleComparison):
    """A comparison of an indicator with a peer's; ``p_equal``: p-value of a difference beyond the margin."""

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
    """Return the indicators of a final front; an empty one counts as the hypervolume's reference point."""
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
    """Test whether an indicator (seeds,) differs from a peer's, and whether it equals it within a margin."""
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
        if p < LEVEL:
            verdict = "loss" if row.a12 < 0.5 else "win"
        if p_equal < LEVEL:
            verdict = f"{verdict}, within margin" if verdict != "undecided" else "equal"
        decided.append(replace(row, p_holm=float(p), p_equal_holm=float(p_equal), verdict=verdict))
    grades = ["loss", "loss, within margin", "undecided", "equal", "win, within margin", "win"]
    return sorted(decided, key=lambda row: (grades.index(row.verdict), row.indicator, row.a12))


def comparison_row(table: str, comparison: Comparison, verdict: str) -> Row:
    """Return a comparison as a row: our median and the peer's, the verdict and the tests in the note."""
    column = f"{comparison.indicator} compared with {comparison.peer}"
    note = f"{verdict}; {comparison.tests}"
    row = comparison.problem
    return Row(table, row, column, "", comparison.ours, reference=comparison.theirs, source=comparison.peer, note=note)


def tally_rows(table: str, decided: Sequence[Comparison], group: Callable[[Comparison], str]) -> list[Row]:
    """Return the numbers of wins and losses in each group of comparisons, most losses first."""
    counts: dict[str, Counter[str]] = {}
    for one in decided:
        counts.setdefault(group(one), Counter())[one.verdict.split(",")[0]] += 1
    return [
        Row(
            table,
            name,
            "wins, compared with losses",
            "",
            count["win"],
            reference=count["loss"],
            source="losses",
            note=f"equal {count['equal']}, undecided {count['undecided']}",
        )
        for name, count in sorted(counts.items(), key=lambda item: item[1]["win"] - item[1]["loss"])
    ]
