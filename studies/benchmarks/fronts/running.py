"""Running every method on every case, interleaved, under both budgets; one process per core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np

from paretoik.arrays import Objectives, Values
from paretoik.runs.distribution import Executor
from studies.benchmarks.fronts.cases import CASES, POPULATION, Budget, Kind, Run, problem_of
from studies.benchmarks.fronts.methods import (
    CELLS,
    FACTORS,
    OURS,
    PLAIN,
    PYGMO,
    PYMOO,
    cell_run,
    ours,
    pygmo_run,
    pymoo_run,
)
from studies.benchmarks.fronts.sweeps import FATROP, IPOPT, epsilon_run, library_of, peer_of
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.processes import processes, rotated, run_each, run_seeds
from studies.reporting import Row, tell
from studies.significance import (
    MARGIN,
    Comparison,
    bootstrap_interval,
    compare,
    comparison_row,
    decide,
    scores,
    tally_rows,
)

Found: TypeAlias = dict[tuple[str, Kind], dict[str, list[Run]]]  # runs of every seed by method, case and budget

KINDS: tuple[Kind, ...] = ("evaluations", "CPU time")
LIMIT = 600.0  # seconds after which a run, which takes about ten, counts as empty


def methods_of(case: str) -> list[str]:
    """Return the names of all methods that can run on a case, ours first."""
    return [OURS, PLAIN, EPSILON, *CELLS, *PYMOO, *PYGMO, *[FATROP] * CASES[case].staged, IPOPT]


def run(case: str, name: str, seed: int, budget: Budget, evaluations: int, library: str = "") -> Run:
    """Run one method once, after a warm-up; by names so that it can run in another process."""
    gradients = name == OURS or (name in CELLS and CELLS[name].refined)
    _warm_up(case, name if name in (EPSILON, FATROP, IPOPT) else OURS if gradients else PYMOO[0], library)
    return _run(case, name, seed, budget, evaluations, library)


@lru_cache(maxsize=256)
def _warm_up(case: str, name: str, library: str) -> None:
    """Compile and load everything that a method and similar ones need, in this process, before they are timed."""
    _run(case, name, 0, Budget(kind="evaluations", amount=3 * POPULATION), 3 * POPULATION, library)


def _run(case: str, name: str, seed: int, budget: Budget, evaluations: int, library: str) -> Run:
    problem = problem_of(case)
    if name in (OURS, PLAIN):
        return ours(problem, seed, budget, evaluations // POPULATION, refine=name == OURS)
    if name in CELLS:
        return cell_run(CELLS[name], problem, seed, budget)
    if name in PYMOO:
        return pymoo_run(name, problem, seed, budget)
    if name in PYGMO:
        return pygmo_run(name, problem, seed, budget)
    return epsilon_run(problem, seed, budget, None if name == EPSILON else peer_of(name, case, library))


def run_all(
    chosen: Sequence[str],
    kinds: Sequence[Kind],
    seeds: int,
    evaluations: int | None = None,
    *,
    compiling: bool = True,
    cluster: str | None = None,
) -> Found:
    """Run everything, seeds outermost, the order of methods rotating, one process per core."""
    sizes = {case: evaluations or CASES[case].evaluations for case in chosen}
    with TemporaryDirectory() as folder, processes(cluster) as executor:
        libraries = _libraries(executor, chosen, Path(folder) if compiling else None)
        budgets = {case: _budgets(executor, case, sizes[case], kinds) for case in chosen}

        def arguments(seed: int) -> dict[tuple[str, str, Kind], list[Any]]:
            return {
                (case, name, kind): [case, name, seed, budget, sizes[case], libraries.get((case, name), "")]
                for case in chosen
                for name in rotated(methods_of(case), seed)
                for kind, budget in budgets[case].items()
            }

        every = run_seeds(executor, run, arguments, seeds, limit=LIMIT, empty=lambda key: empty_run(key[0]))
    results: Found = {}
    for (case, name, kind), runs in every.items():
        results.setdefault((case, kind), {})[name] = runs
    return results


def empty_run(case: str) -> Run:
    """Return a run that found nothing."""
    F = np.empty((0, problem_of(case).n_obj))
    return Run(F=F, failed=0, evaluations=0, iterations=0, seconds=0.0)


def _libraries(executor: Executor, chosen: Sequence[str], folder: Path | None) -> dict[tuple[str, str], str]:
    names = [(case, name) for case in chosen for name in methods_of(case) if name in (FATROP, IPOPT)]
    libraries = run_each(executor, {(case, name): partial(library_of, name, case, folder) for case, name in names})
    tell("peers: built")
    return libraries


def _budgets(executor: Executor, case: str, evaluations: int, kinds: Sequence[Kind]) -> dict[Kind, Budget]:
    same = Budget(kind="evaluations", amount=evaluations)
    budgets: dict[Kind, Budget] = {"evaluations": same}
    if "CPU time" in kinds:
        name = PYMOO[0]
        runs = {(name, case, f"seed {seed}"): partial(run, case, name, seed, same, evaluations) for seed in range(3)}
        taken = [done.seconds for done in run_each(executor, runs).values()]
        budgets["CPU time"] = Budget(kind="CPU time", amount=float(np.median(taken)))
        tell(f"{case}: {evaluations} evaluations, {budgets['CPU time'].amount:.2f} s")
    return budgets


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
            ADDED,
            one.case,
            f"{one.factors}, {one.indicator}",
            "",
            one.mean,
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
        rows.append(Row(LEFT, f"{case}, equal {kind}", name, "", volume, note=note))
    return sorted(rows, key=lambda row: -row.ours)
