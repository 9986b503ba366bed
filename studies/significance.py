"""Tests of two methods' values over seeds, p-values of several tests, and bootstrap intervals."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import DegenerateDataWarning, bootstrap, mannwhitneyu

from paretoik.arrays import Values


@dataclass(frozen=True, kw_only=True)
class SignificanceOptions:
    """The ``level`` of tests, the ``confidence`` of intervals, and the number of ``resamples``."""

    level: float = 0.05
    confidence: float = 0.95
    resamples: int = 2000


SIGNIFICANCE = SignificanceOptions()


@dataclass(frozen=True, kw_only=True)
class SampleComparison:
    """Medians of two methods over seeds, their ``ratio`` with its bootstrap interval, and a Mann-Whitney test.

    ``a12`` is the probability that a value of ours is better than one of theirs, ties counted half (Vargha & Delaney
    2000); ``p`` is that of no difference, not corrected for other tests.
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
    """Return the percentile interval of a statistic of independent samples, which takes an ``axis``.

    Not the bias-corrected one (BCa): its jackknife fails for medians (Efron & Tibshirani 1993, chapter 11), and it does
    not exist for equal values. The interval is NaN if a sample has fewer than two values, or if the statistic of a
    resample is not finite.
    """
    if min(map(len, samples)) < 2:
        return float("nan"), float("nan")
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateDataWarning)  # about a NaN, which is returned
        result = bootstrap(
            samples,
            statistic,
            method="percentile",
            n_resamples=SIGNIFICANCE.resamples,
            confidence_level=SIGNIFICANCE.confidence,
            rng=0,
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
