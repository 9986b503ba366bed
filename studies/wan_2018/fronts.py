"""A fair comparison: the fronts from searching the parameters of either method, from the same starts.

Both families are searched with equal evaluations, seeds alternating. Their fronts are compared in logarithms of error,
speed and roughness, over the ranges of the best of all, by the same tests as peers elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import moocore
import numpy as np

import paretoik as pk
from paretoik.runs.distribution import Executor
from problems import wan_2018
from studies.processes import run_each
from studies.reporting import Row, tell
from studies.significance import LEVEL, SampleComparison, compare_samples, holm

Fronts = Mapping[str, Sequence[np.ndarray]]  # of each seed, by family
FAMILIES = {"weighted": wan_2018.weighted_gains, "plain": wan_2018.plain_gains}
LEAST = np.array([1e-9, -np.inf, 1e-9, 1e-9])  # lower bounds before logarithms
CORNER = 1.1  # of the ranges: the reference point of the hypervolume
LOW, HIGH = 0.01, 0.02  # quantiles left out of the ranges at either end: useless values


def search_front(family: str, seed: int, *, population: int, generations: int, judged_starts: int) -> np.ndarray:
    """Return the front (points, 4), minimised, from a search of a family's parameters."""
    problem = FAMILIES[family](judged_starts)
    front = pk.solve(problem, population=population, generations=generations, seed=seed)
    signs = np.where(problem.maximised, -1.0, 1.0)
    return np.asarray(front.objectives * signs)


def comparison_rows(
    *, seeds: int, population: int = 24, generations: int = 15, judged_starts: int = 3, executor: Executor | None = None
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
    with np.errstate(invalid="ignore", divide="ignore"):  # powers of ten; the margin, which can be negative, stays
        logarithms = {
            key: np.where(np.isfinite(LEAST), np.log10(np.maximum(F, LEAST)), F) for key, F in results.items()
        }
    fronts = {family: [logarithms[family, f"seed {seed}"] for seed in range(seeds)] for family in FAMILIES}
    compared = dict[str, SampleComparison]()
    for name, measure in _indicators(fronts).items():
        ours, theirs = (np.array([float(measure(front)) for front in fronts[family]]) for family in FAMILIES)
        compared[name] = compare_samples(ours, theirs, maximised=name == "hypervolume")
    rows = list[Row]()
    title = f"fronts of WGPM beside GPM, {seeds} seeds, {population * generations} evaluations each"
    for (name, each), p in zip(compared.items(), holm([each.p for each in compared.values()]), strict=True):
        winner = "undecided" if p > LEVEL else "WGPM wins" if each.a12 > 0.5 else "LOSS, GPM wins"
        ratio = f"ratio of medians {each.ratio_low:.3f} to {each.ratio_high:.3f}"
        note = f"from {judged_starts} starts each: {winner}, p {p:.1e} (Holm), A12 {each.a12:.2f}, {ratio}"
        place = title, "path of section 3.2", f"{name}, median", ""
        rows.append(Row(*place, each.ours, reference=each.theirs, source="GPM", note=note))
    return rows


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
