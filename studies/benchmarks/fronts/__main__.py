"""Gains by MaxiMin, seeding and refinement, and comparisons of whole fronts with peers; losses first.

    python -m studies.benchmarks.fronts [--quick] [--seeds N] [--problems NAME ...] [--cluster ADDRESS] [--json FILE]

All eight cells of a factorial, our ``pk.solve`` and peers, at equal evaluations (an iteration with derivatives is one)
and at equal CPU time, that of pymoo's NSGA-II for those evaluations. Peers get our batched evaluation, encoding, seeds
and archive; a method hands in at most 100 points, spread by MaxiMin. Points with a violation above 1e-8 or off the path
by more than 1e-6 are absent. Statistics are those of ``benchmarks.maximin``; effects are contrasts of the cells'
hypervolumes, seeds as blocks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np

from paretoik.arrays import Values
from paretoik.runs.distribution import Executor
from studies.benchmarks.fronts.methods import (
    CASES,
    CELLS,
    FACTORS,
    OURS,
    POPULATION,
    PYGMO,
    PYMOO,
    SAME,
    Budget,
    Kind,
    Run,
    cell_run,
    ours,
    problem_of,
    pygmo_run,
    pymoo_run,
)
from studies.benchmarks.fronts.sweeps import FATROP, IPOPT, epsilon_run, library_of, peer_of
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.benchmarks.peers.solvers import COMPILER
from studies.benchmarks.reference_front import reference_front
from studies.processes import processes, rotated, run_each, run_seeds
from studies.reporting import Row, report, study_parser, tell
from studies.significance import (
    MARGIN,
    Comparison,
    bootstrap_interval,
    compare,
    comparison_row,
    decide,
    scores,
    tally_rows,
    union,
)

Found: TypeAlias = dict[tuple[str, Kind], dict[str, list[Run]]]  # runs of every seed by method, case and budget
Scores = Mapping[str, Sequence[dict[str, float]]]  # of every seed, by method

QUICK, QUICK_EVALUATIONS = ("energy_torque", "simulation 1"), 1200
LIMIT = 600.0  # seconds after which a run, which takes about ten, counts as empty
COMPARED, ADDED, COUNTED, LEFT = (
    "our fronts beside the peers', medians (hypervolume: more is better; IGD+, epsilon: less)",
    "what each factor adds to the hypervolume, with 95 % bootstrap interval",
    "wins and losses over problems and indicators",
    "what every method left: median normalised hypervolume, and what it spent",
)


def methods_of(case: str) -> list[str]:
    """Return the names of all methods that can run on a case, ours first."""
    return [OURS, EPSILON, *CELLS, *PYMOO, *PYGMO, *[FATROP] * CASES[case].staged, IPOPT]


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
    if name == OURS:
        return ours(problem, seed, budget, evaluations // POPULATION)
    if name in CELLS:
        return cell_run(CELLS[name], problem, seed, budget)
    if name in PYMOO:
        return pymoo_run(name, problem, seed, budget)
    if name in PYGMO:
        return pygmo_run(name, problem, seed, budget)
    return epsilon_run(problem, seed, budget, None if name == EPSILON else peer_of(name, case, library))


def run_all(
    chosen: Sequence[str], seeds: int, evaluations: int | None, *, compiling: bool, cluster: str | None = None
) -> Found:
    """Run everything, seeds outermost, the order of methods rotating, one process per core."""
    sizes = {case: evaluations or CASES[case].evaluations for case in chosen}
    with TemporaryDirectory() as folder, processes(cluster) as executor:
        names = [(case, name) for case in chosen for name in methods_of(case) if name in (FATROP, IPOPT)]
        into = Path(folder) if compiling else None
        libraries = run_each(executor, {(case, name): partial(library_of, name, case, into) for case, name in names})
        tell("peers: built")
        budgets = {case: _budgets(executor, case, sizes[case]) for case in chosen}

        def arguments(seed: int) -> dict[tuple[str, str, Kind], list[Any]]:
            return {
                (case, name, budget.kind): [case, name, seed, budget, sizes[case], libraries.get((case, name), "")]
                for case in chosen
                for name in rotated(methods_of(case), seed)
                for budget in budgets[case]
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


def _budgets(executor: Executor, case: str, evaluations: int) -> tuple[Budget, Budget]:
    same, name = Budget(kind="evaluations", amount=evaluations), PYMOO[0]
    runs = {(name, case, f"seed {seed}"): partial(run, case, name, seed, same, evaluations) for seed in range(3)}
    seconds = float(np.median([done.seconds for done in run_each(executor, runs).values()]))
    tell(f"{case}: {evaluations} evaluations, {seconds:.2f} s")
    return same, Budget(kind="CPU time", amount=seconds)


def comparisons(case: str, kind: str, scores: Scores) -> list[Comparison]:
    """Compare each of our methods with every peer, not yet corrected for their number."""
    mine = (OURS, EPSILON)
    rows = []
    for method, peer, indicator in product(mine, scores, MARGIN):
        if peer not in (*CELLS, *mine):
            sides = [np.array([score[indicator] for score in scores[name]]) for name in (method, peer)]
            rows.append(compare(f"{case}, equal {kind}", indicator, f"{peer}: {method}", *sides))
    return rows


def effect_rows(case: str, scores: Scores) -> list[Row]:
    """Return what each factor adds to the hypervolume: half of the cells less the other half, seeds as blocks."""
    table: Values = np.array([[score["hypervolume"] for score in scores[name]] for name in CELLS])
    levels = np.array([(cell.maximin, cell.seeded, cell.refined) for cell in CELLS.values()])
    rows = []
    for factor, level in zip(FACTORS, levels.T, strict=True):
        each = np.where(level, 0.25, -0.25) @ table
        low, high = bootstrap_interval(np.mean, each)
        verdict = "helps" if low > 0 else "HURTS" if high < 0 else "undecided"
        rows.append(Row(ADDED, case, factor, "", float(each.mean()), note=f"{verdict} [{low:.4f}, {high:.4f}]"))
    return rows


def comparison_rows(every: Sequence[Comparison]) -> list[Row]:
    """Return comparisons, losses first, after Holm over all of them, and their count by peer."""
    grades = ["loss", "undecided", "equal", "win"]
    decided = sorted(decide(every), key=lambda one: (grades.index(one.verdict.split(",")[0]), one.a12))
    rows = [
        comparison_row(COMPARED, one, one.verdict.upper() if one.verdict.startswith("loss") else one.verdict)
        for one in decided
    ]
    return [*rows, *tally_rows(COUNTED, decided, lambda one: f"{one.peer}, {one.problem.split(', ')[-1]}")]


def left_rows(case: str, kind: str, runs: Mapping[str, Sequence[Run]], scores: Scores) -> list[Row]:
    """Return the results and costs of every method, cells included."""
    rows = []
    for name, each in runs.items():
        volume = float(np.median([score["hypervolume"] for score in scores[name]]))
        evaluations, iterations, seconds = np.median(
            [(one.evaluations, one.iterations, one.seconds) for one in each], axis=0
        )
        note = (
            f"{np.median([len(run.F) for run in each]):.0f} points, {sum(run.failed for run in each)} failed the "
            f"verifier in all, {sum(not len(run.F) for run in each)} of {len(each)} runs empty; "
            f"{evaluations:.0f} evaluations, {iterations:.0f} iterations, {seconds:.2f} s CPU"
        )
        rows.append(Row(LEFT, f"{case}, equal {kind}", name, "", volume, note=note))
    return sorted(rows, key=lambda row: -row.ours)


def rows_of(results: Found) -> list[Row]:
    """Judge all runs: of a case against the union of its fronts under all budgets and the stored front."""
    compared, added, spent = list[Comparison](), list[Row](), list[Row]()
    for case in dict.fromkeys(name for name, _ in results):
        fronts = [
            one.F for (name, _), runs in results.items() if name == case for each in runs.values() for one in each
        ]
        fronts += [reference_front()] if case == "energy_torque" else []
        reference = union(fronts)
        if not len(reference):
            print(f"{case}: no method found a point that the verifier accepts: not judged")
            continue
        for (name, kind), runs in results.items():
            if name == case:
                judged = {method: [scores(one.F, reference) for one in each] for method, each in runs.items()}
                compared += comparisons(case, kind, judged)
                added += effect_rows(f"{case}, equal {kind}", judged)
                spent += left_rows(case, kind, runs, judged)
    return [*comparison_rows(compared), *sorted(added, key=lambda row: not row.note.startswith("HURTS")), *spent]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(
        __doc__, quick="two problems, few evaluations, 3 seeds", cluster="all runs (they see this machine's files)"
    )
    parser.add_argument("--seeds", type=int, help="runs of each method (31; 3 with --quick)")
    parser.add_argument("--problems", nargs="+", choices=list(CASES), metavar="NAME", help="only these problems")
    options = parser.parse_args(arguments)
    seeds = options.seeds if options.seeds is not None else 3 if options.quick else 31
    if seeds < 2:
        parser.error(f"--seeds must be at least 2, got {seeds}")
    evaluations = QUICK_EVALUATIONS if options.quick else None
    chosen = options.problems or (QUICK if options.quick else list(CASES))
    left_out = {
        "left out: pymoo's pcd crowding, which crashes with three objectives": True,
        "left out: pygmo, which is not installed": not PYGMO,
        **{f"left out: ε-constraints by FATROP on {case}": not CASES[case].staged for case in chosen},
        "FATROP and IPOPT run with CasADi's own evaluation, not compiled": options.quick or COMPILER is None,
    }
    print("\n".join([SAME, *(words for words, is_so in left_out.items() if is_so)]))
    results = run_all(chosen, seeds, evaluations, compiling=not options.quick, cluster=options.cluster)
    if min((len(runs) for each in results.values() for runs in each.values()), default=0) < 2:
        parser.exit(1, "interrupted before two seeds were done: nothing to judge\n")
    report(rows_of(results), json_file=options.json)


if __name__ == "__main__":
    from studies.benchmarks.fronts.__main__ import main as named_main  # workers know its functions by this name

    named_main()
