"""Who really wins: the fronts that searching the numbers of either method gives, from the same places.

Both families are searched with equal evaluations, seeds in turn; their fronts are compared in logarithms of error,
speed and roughness, over the ranges of the best of all, by the rules that peers are compared by elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import moocore
import numpy as np
from scipy.stats import bootstrap, mannwhitneyu

import paretoik as pk
from paretoik.distribution import Executor
from problems import wan_2018
from studies.processes import run_each
from studies.reporting import Row, holm, tell

Fronts = Mapping[str, Sequence[np.ndarray]]  # of each seed, by family
FAMILIES = {"weighted": wan_2018.weighted_gains, "plain": wan_2018.plain_gains}
LEAST = np.array([1e-9, -np.inf, 1e-9, 1e-9])  # of what logarithms are taken
LEVEL = 0.05
CORNER = 1.1  # of the ranges: the reference point of the hypervolume
LOW, HIGH = 0.01, 0.02  # quantiles that the ranges leave out at either end: what no one would use


def search_front(family: str, seed: int, *, population: int, generations: int, judged_starts: int) -> np.ndarray:
    """Return the front (points, 4), minimised, that a search of a family's numbers gives."""
    problem = FAMILIES[family](judged_starts)
    front = pk.solve(problem, population=population, generations=generations, seed=seed)
    signs = np.where(problem.maximised, -1.0, 1.0)
    return np.asarray(front.objectives * signs)


def comparison_rows(
    *,
    seeds: int,
    population: int = 24,
    generations: int = 15,
    judged_starts: int = 3,
    executor: Executor | None = None,
) -> list[Row]:
    """Return indicators of both families' fronts, medians over seeds, and whether they differ."""
    search = {"population": population, "generations": generations, "judged_starts": judged_starts}
    searches = {
        (family, f"seed {seed}"): partial(search_front, family, seed, **search)
        for seed in range(seeds)
        for family in FAMILIES
    }
    tell(f"fronts of {' and '.join(FAMILIES)}, {seeds} seeds")
    results = run_each(executor, searches)
    fronts = {family: [_log_scale(results[family, f"seed {seed}"]) for seed in range(seeds)] for family in FAMILIES}
    compared = [_compare(name, measure, fronts) for name, measure in _indicators(fronts).items()]
    return [
        Row(
            table=f"fronts of WGPM beside GPM, {seeds} seeds, {population * generations} evaluations each",
            row="path of section 3.2",
            column=f"{each.name}, median",
            unit="",
            ours=each.ours,
            reference=each.theirs,
            source="GPM",
            note=f"from {judged_starts} starts each: {each.verdict(p)}",
        )
        for each, p in zip(compared, holm([each.p for each in compared]), strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Medians of an indicator, the p of their difference alone, A12 and the ``ratio`` of medians with its interval."""

    name: str
    ours: float
    theirs: float
    p: float
    better: float
    ratio: tuple[float, float]

    def verdict(self, p: float) -> str:
        """Return who wins where `p` is that of the difference among all that are tested."""
        winner = "undecided" if p > LEVEL else "WGPM wins" if self.better > 0.5 else "LOSS, GPM wins"
        low, high = self.ratio
        return f"{winner}, p {p:.1e} (Holm), A12 {self.better:.2f}, ratio of medians {low:.3f} to {high:.3f}"


def _indicators(fronts: Fronts) -> dict[str, Callable[[np.ndarray], float]]:
    """Return indicators of a front by name, over the ranges of the best of all."""
    union = np.concatenate([front for each in fronts.values() for front in each])
    union = union[moocore.is_nondominated(union)]
    lower, upper = np.quantile(union, [LOW, 1 - HIGH], axis=0)
    span = np.where(upper > lower, upper - lower, 1.0)

    def normalise(front: np.ndarray) -> np.ndarray:
        return np.clip((front - lower) / span, 0.0, None)

    best = normalise(union)
    return {
        "hypervolume": lambda front: moocore.hypervolume(normalise(front), ref=[CORNER] * front.shape[1]),
        "IGD+": lambda front: moocore.igd_plus(normalise(front), ref=best),
        "additive ε": lambda front: moocore.epsilon_additive(normalise(front), ref=best),
    }


def _compare(name: str, measure: Callable[[np.ndarray], float], fronts: Fronts) -> Comparison:
    """Return how an indicator of both families' fronts compares."""
    ours, theirs = (np.array([float(measure(front)) for front in fronts[family]]) for family in FAMILIES)
    test = mannwhitneyu(ours, theirs)
    larger = float(test.statistic) / len(ours) / len(theirs)
    interval = bootstrap((ours, theirs), _ratio, vectorized=False, n_resamples=2000, rng=0).confidence_interval
    return Comparison(
        name=name,
        ours=float(np.median(ours)),
        theirs=float(np.median(theirs)),
        p=float(test.pvalue),
        better=larger if name == "hypervolume" else 1 - larger,
        ratio=(float(interval.low), float(interval.high)),
    )


def _ratio(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.median(ours) / np.median(theirs))


def _log_scale(front: np.ndarray) -> np.ndarray:
    """Return error, speed and roughness as powers of ten; the margin as it is."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(np.isfinite(LEAST), np.log10(np.maximum(front, LEAST)), front)
