"""MaxiMin beside pymoo's selections: same evaluations, same first populations, seeds interleaved; losses first.

    python -m studies.benchmarks.maximin [--quick] [--seeds N] [--problems NAME ...] [--fronts FOLDER] [--json FILE]

Peers are as pymoo ships them: NSGA-II with crowding "cd", "pcd" (two objectives only, in a process of its own: it
crashes with more) and "mnn", NSGA-III with one reference direction an individual, and SMS-EMOA (not with five
objectives, where one generation takes seconds). All start from the same seeded genes and evaluate whole batches. The
final populations are judged by hypervolume (reference 1.1), IGD+ and additive epsilon after normalising by the union of
all fronts; with --fronts that union is stored and joined with what was stored before. On the steep tail only the useful
corner counts, and MaxiMin is also compared with itself when told of that corner by ``ranges=``.

A loss or a win is a significant Mann-Whitney test; "equal" (or "within margin") are two one-sided ones against the peer
scaled by one minus and one plus the margin of the indicator; both by Holm over the whole table, the rest is undecided.
A12 is the chance that a MaxiMin run is the better one.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from moocore import is_nondominated
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.core.problem import Problem
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.util.ref_dirs import get_reference_directions
from rich.console import Console

from paretoik.arrays import Genes, Objectives
from paretoik.search.nsga2 import MaxiMinNSGA2
from paretoik.search.seeding import seeded_population
from problems.tringali_2020 import energy_torque
from studies.benchmarks.significance import MARGIN, Comparison, compare, comparison_row, decide, scores
from studies.reporting import Row, report, study_parser

OURS = "MaxiMin"
BOXED = "MaxiMin, ranges="
ISOLATED = "pcd"
PARTITIONS = {2: 99, 3: 12, 5: 5}
POPULATION = {2: 100, 3: 91, 5: 126}
TABLE = f"{OURS} beside its peers, medians (hypervolume: more is better; IGD+, epsilon: less)"
COST = "median CPU time of a run, at equal evaluations"


class SteepTail(Problem):  # type: ignore[misc]  # pymoo has no types
    """f1 = x1, f2 = g / x1 with x1 from 0.001: a front of which the useful corner is a small part."""

    def __init__(self) -> None:
        super().__init__(n_var=10, n_obj=2, xl=np.r_[1e-3, np.zeros(9)], xu=np.ones(10))

    def _evaluate(self, x: Genes, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
        out["F"] = np.column_stack((x[:, 0], g / x[:, 0]))


@dataclass(frozen=True)
class Case:
    """A problem, its budget, and the box of interest outside which points count as absent."""

    name: str
    make: Callable[[], Any]
    n_obj: int
    generations: int
    box: tuple[tuple[float, ...], tuple[float, ...]] | None = None  # lower, upper


@dataclass(frozen=True)
class Run:
    """What one run left: its final non-dominated objectives (points, n_obj) and its CPU seconds."""

    F: Objectives
    seconds: float


def dtlz(number: int, n_obj: int) -> Any:
    """Return DTLZ 1, 2 or 7 with the usual number of variables."""
    distance = {1: 5, 2: 10, 7: 20}[number]
    return get_problem(f"dtlz{number}", n_var=n_obj - 1 + distance, n_obj=n_obj)


def cases() -> dict[str, Case]:
    """Every problem by name."""
    zdt = [Case(f"ZDT{k}", lambda k=k: get_problem(f"zdt{k}"), 2, 250) for k in (1, 2, 3, 4, 6)]  # type: ignore[misc]
    many = [
        Case(f"DTLZ{k}-{m}", lambda k=k, m=m: dtlz(k, m), m, 400 if k == 1 else 250)  # type: ignore[misc]
        for m in (3, 5)
        for k in (1, 2, 7)
    ]
    steep = Case("steep tail", SteepTail, 2, 150, box=((0.0, 1.0), (1.0, 20.0)))
    return {case.name: case for case in (*zdt, *many, steep, Case("energy_torque", energy_torque, 2, 60))}


QUICK = {"ZDT1": 100, "ZDT3": 100, "DTLZ2-3": 60, "steep tail": 60}


def peers(case: Case) -> list[str]:
    """Names of the methods that can run on a case, ours first."""
    names = [OURS, "cd", "mnn", "NSGA-III"]
    names += ["pcd"] if case.n_obj == 2 else []
    names += ["SMS-EMOA"] if case.n_obj < 5 else []
    return names + ([BOXED] if case.box else [])


def algorithm(name: str, case: Case, first: Genes) -> Any:
    """Return a fresh algorithm that starts from ``first``."""
    size = len(first)
    if name in (OURS, BOXED):
        return MaxiMinNSGA2(pop_size=size, sampling=first, ranges=case.box if name == BOXED else None)
    if name == "NSGA-III":
        directions = get_reference_directions("das-dennis", case.n_obj, n_partitions=PARTITIONS[case.n_obj])
        return NSGA3(directions, pop_size=size, sampling=first)
    if name == "SMS-EMOA":
        return SMSEMOA(pop_size=size, sampling=first)
    return NSGA2(pop_size=size, sampling=first, survival=RankAndCrowding(crowding_func=name))


def run(case_name: str, name: str, seed: int, generations: int) -> Run:
    """Run one method once; looked up by name so that it can happen in another process."""
    case = cases()[case_name]
    problem = case.make()
    size = POPULATION[case.n_obj]
    first = seeded_population(problem, size, rng=np.random.default_rng([seed, size]))
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own, about divisions
        result = minimize(problem, algorithm(name, case, first), ("n_eval", size * generations), seed=seed)
    seconds = time.process_time() - started
    F = np.empty((0, case.n_obj)) if result.F is None else np.atleast_2d(result.F)
    F = F[np.isfinite(F).all(axis=1)]
    if case.box is not None:
        F = F[np.less_equal(F, case.box[1]).all(axis=1)]
    return Run(F[is_nondominated(F, keep_weakly=False)] if len(F) else F, seconds)


def run_all(chosen: Sequence[Case], seeds: int, console: Console) -> dict[tuple[str, str], list[Run]]:
    """Run every method on every case, seeds outermost and the order of methods turning."""
    runs: dict[tuple[str, str], list[Run]] = {}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as aside, console.status("") as status:
        for seed in range(seeds):
            for case in chosen:
                names = peers(case)
                for name in names[seed % len(names) :] + names[: seed % len(names)]:
                    status.update(f"seed {seed + 1} of {seeds}: {case.name}, {name}")
                    work = (case.name, name, seed, case.generations)
                    try:
                        done = aside.submit(run, *work).result() if name == ISOLATED else run(*work)
                    except BrokenProcessPool:
                        raise SystemExit(f"{name} crashed on {case.name}, seed {seed}") from None
                    runs.setdefault((case.name, name), []).append(done)
    return runs


def union_front(case: Case, runs: Sequence[Run], folder: Path | None) -> Objectives:
    """Join all fronts of a case, with what is stored of it, and store the result."""
    every = [one.F for one in runs]
    file = None if folder is None else folder / f"{case.name.replace(' ', '_')}.npz"
    if file is not None and file.exists():
        with np.load(file, allow_pickle=False) as stored:
            every.append(stored["F"])
    F = np.concatenate(every)
    union: Objectives = F[is_nondominated(F, keep_weakly=False)]
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(file, F=union)
    return union


def compare_all(
    runs: dict[tuple[str, str], list[Run]], chosen: Sequence[Case], folder: Path | None
) -> list[Comparison]:
    """Score all runs and compare ours with every peer."""
    rows = []
    for case in chosen:
        names = peers(case)
        union = union_front(case, [one for name in names for one in runs[case.name, name]], folder)
        table = {name: [scores(one.F, union) for one in runs[case.name, name]] for name in names}
        for peer in names[1:]:
            for indicator in MARGIN:
                ours, theirs = (np.array([score[indicator] for score in table[name]]) for name in (OURS, peer))
                rows.append(compare(case.name, indicator, peer, ours, theirs))
    return decide(rows)


def cost_rows(runs: dict[tuple[str, str], list[Run]], chosen: Sequence[Case]) -> list[Row]:
    """Return the cost of every method on every case."""
    rows = []
    for case in chosen:
        note = f"{POPULATION[case.n_obj] * case.generations} evaluations"
        for name in peers(case):
            seconds = float(np.median([one.seconds for one in runs[case.name, name]]))
            rows.append(Row(table=COST, row=case.name, column=name, unit="s", ours=seconds, note=note))
    return rows


def choose_cases(names: Sequence[str], *, quick: bool, console: Console) -> list[Case]:
    """Choose cases and, for --quick, shorten them; say what is left out."""
    every = cases()
    unknown = sorted(set(names) - set(every))
    if unknown:
        raise SystemExit(f"--problems: some of {', '.join(every)} wanted, got {', '.join(unknown)}")
    chosen = [every[name] for name in names or (QUICK if quick else every)]
    if quick:
        chosen = [replace(case, generations=QUICK.get(case.name, 60)) for case in chosen]
        console.print(f"quick: {', '.join(f'{case.name} {case.generations} generations' for case in chosen)} only")
    if any(case.n_obj == 5 for case in chosen):
        console.print("left out: SMS-EMOA with five objectives, where one generation takes seconds")
    return chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__.splitlines()[0], quick="four problems, few generations, 11 seeds")
    parser.add_argument("--seeds", type=int, help="runs of each method (31; 11 with --quick)")
    parser.add_argument("--problems", nargs="+", default=[], metavar="NAME", help="only these problems")
    parser.add_argument("--fronts", type=Path, metavar="FOLDER", help="keep the union fronts here and add to them")
    options = parser.parse_args(arguments)
    seeds = options.seeds if options.seeds is not None else (11 if options.quick else 31)
    if seeds < 2:
        parser.error(f"--seeds: at least 2 wanted, got {seeds}")
    console = Console()
    chosen = choose_cases(options.problems, quick=options.quick, console=console)
    runs = run_all(chosen, seeds, console)
    comparisons = compare_all(runs, chosen, options.fronts)
    rows = [comparison_row(TABLE, one, one.verdict) for one in comparisons]
    report([*rows, *cost_rows(runs, chosen)], json_file=options.json)


if __name__ == "__main__":
    main()
