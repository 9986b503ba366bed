"""MaxiMin against pymoo's algorithms: same evaluations, same first populations, seeds interleaved; losses first.

    python -m studies.benchmarks.maximin [--quick] [--goals | --peers NAME ...] [--seeds N] [--problems NAME ...]
                                         [--runs FOLDER] [--cluster ADDRESS] [--json FILE]

Ours are ``MaxiMinNSGA2`` and ``NSGA2(survival=MaxiMin())``, which differ only in the mating. Peers have pymoo's
defaults; those with reference directions have one per individual. ``--goals`` selects the peers of our goals,
``--problems`` names and families. The final populations are judged by hypervolume (reference 1.1), IGD+ and additive
epsilon, normalised by the union of all fronts; a run without a feasible point counts as the corner. On the steep tail
only the useful corner counts.

A loss or a win is a significant Mann-Whitney test; "equal" (or "within margin") are two one-sided tests against the
peer scaled by one minus and one plus the indicator's margin. Both are corrected by Holm over the table of each of ours.
A12 is the probability that one of our runs is the better one. Control-C judges the seeds that are done. With --runs
every run is stored, and a later call resumes; runs of ours are repeated after any change of ``paretoik/search``.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pymoo
from pymoo.algorithms.moo.age import AGEMOEA
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.core.problem import Problem
from pymoo.operators.crossover.pntx import TwoPointCrossover
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.sampling.rnd import BinaryRandomSampling
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.util.ref_dirs import get_reference_directions

import paretoik.search
from paretoik.arrays import Genes, Objectives
from paretoik.runs.file_replacement import replace_file
from paretoik.runs.files import array_bytes
from paretoik.search.genes import has_real_genes, seeded_population
from paretoik.search.maximin import MaxiMin
from paretoik.search.nsga2 import MaxiMinNSGA2
from problems.tringali_2020 import energy_torque
from studies.processes import processes, rotated, run_seeds
from studies.reporting import Row, report, study_parser
from studies.significance import MARGIN, Comparison, compare, comparison_row, decide, scores, tally_rows, union

POPULATION = {2: 100, 3: 91, 5: 126}  # by objectives: the number of reference directions of NSGA-III and MOEA/D
BIOBJECTIVE = "bbob-biobj"
COCO = bool(importlib.util.find_spec("cocoex"))
DIMENSION = 5  # of COCO's problems
DIFFICULTY = 4  # of DASCMOP: convergence, diversity and feasibility each made hard by a quarter


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem and its budget; ``peers`` None means all."""

    name: str
    family: str
    make: Callable[[], Any]
    n_obj: int = 2
    generations: int
    constrained: bool = False
    highest: tuple[float, ...] | None = None  # points above do not count
    peers: tuple[str, ...] | None = None
    binary: bool = False  # genes that pymoo calls real


class SteepTail(Problem):  # type: ignore[misc]  # pymoo has no types
    """f1 = x1, f2 = g / x1 with x1 from 0.001: only a small part of the front, a corner, is useful."""

    def __init__(self) -> None:
        super().__init__(n_var=10, n_obj=2, xl=np.r_[1e-3, np.zeros(9)], xu=np.ones(10))

    def _evaluate(self, x: Genes, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
        out["F"] = np.column_stack((x[:, 0], g / x[:, 0]))


class Biobjective(Problem):  # type: ignore[misc]  # pymoo has no types
    """A problem of COCO's suite bbob-biobj, first instance, within the bounds that COCO gives.

    Source: Brockhoff, Auger, Hansen & Tušar 2022, "Using well-understood single-objective functions in multiobjective
    black-box optimization test suites".
    """

    def __init__(self, function: int, dimension: int = DIMENSION) -> None:
        coco: Any = importlib.import_module("cocoex")  # imported here: optional
        suite = coco.Suite(BIOBJECTIVE, "instances: 1", f"dimensions: {dimension}")
        self.function = suite.get_problem_by_function_dimension_instance(function, dimension, 1)
        super().__init__(n_var=dimension, n_obj=2, xl=self.function.lower_bounds, xu=self.function.upper_bounds)

    def _evaluate(self, x: Genes, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = np.array([self.function(row) for row in x])


def pymoo_case(name: str, generations: int, *settings: int, n_obj: int = 2, n_var: int | None = None) -> Case:
    """Return a case of one of pymoo's problems, with that many variables if it is free."""
    sizes = {} if n_var is None else {"n_var": n_var, "n_obj": n_obj}
    make = partial(get_problem, name.lower(), *settings, **sizes)
    family = name.rstrip("0123456789")
    return Case(name=name, family=family, make=make, n_obj=n_obj, generations=generations)


def _cases() -> Iterator[Case]:
    yield from (replace(pymoo_case(f"ZDT{k}", 250), binary=k == 5) for k in range(1, 7))
    distances = {1: 5, 7: 20}  # variables for a point's distance from the front
    for n_obj, numbers in ((3, range(1, 8)), (5, (1, 2, 7))):
        for k in numbers:
            n_var, generations = n_obj - 1 + distances.get(k, 10), 400 if k in (1, 3) else 250
            case = pymoo_case(f"DTLZ{k}", generations, n_obj=n_obj, n_var=n_var)
            yield replace(case, name=f"{case.name}-{n_obj}")
    yield from (pymoo_case(f"WFG{k}", 150, n_var=24) for k in range(1, 10))
    constrained = [
        *(pymoo_case(f"MW{k}", 200, n_obj=3 if k in (4, 8, 14) else 2) for k in range(1, 15)),
        *(pymoo_case(f"CTP{k}", 100) for k in range(1, 9)),
        *(pymoo_case(f"DASCMOP{k}", 200, DIFFICULTY, n_obj=3 if k > 6 else 2) for k in range(1, 10)),
        *(pymoo_case(name, 100) for name in ("BNH", "OSY", "TNK")),
    ]
    yield from (replace(case, constrained=True) for case in constrained)
    for k in range(1, 56) if COCO else ():
        name, make = f"{BIOBJECTIVE} f{k:02d}", partial(Biobjective, k)
        yield Case(name=name, family=BIOBJECTIVE, make=make, generations=100)
    yield Case(name="steep tail", family="steep tail", make=SteepTail, generations=150, highest=(1.0, 20.0))
    energy = "energy_torque"
    yield Case(name=energy, family=energy, make=energy_torque, generations=60, constrained=True)


@cache
def cases() -> dict[str, Case]:
    """Every problem by name."""
    return {case.name: case for case in _cases()}


@cache
def problem_of(name: str) -> Any:
    """Return a case's problem, built once per process."""
    return cases()[name].make()


PARTITIONS = {2: 99, 3: 12, 5: 5}  # by objectives: 100, 91 and 126 reference directions
DISTANCES = {"NSGA-II": "cd", "NSGA-II, pcd": "pcd", "NSGA-II, mnn": "mnn"}
PEERS = (*DISTANCES, "NSGA-III", "SMS-EMOA", "AGE-MOEA", "MOEA/D")


def pymoo_algorithm(name: str, n_obj: int, first: Genes, **operators: Any) -> Any:
    """Return one of ``PEERS``; ``operators`` are a crossover and a mutation if its own do not suit the genes.

    Those with reference directions have one per individual of a population of 100, 91 or 126 (2, 3, 5 objectives).
    """
    settings = {"sampling": first, **operators}
    if name in DISTANCES:
        return NSGA2(pop_size=len(first), survival=RankAndCrowding(crowding_func=DISTANCES[name]), **settings)
    if name in ("SMS-EMOA", "AGE-MOEA"):
        return {"SMS-EMOA": SMSEMOA, "AGE-MOEA": AGEMOEA}[name](pop_size=len(first), **settings)
    directions = get_reference_directions("das-dennis", n_obj, n_partitions=PARTITIONS[n_obj])
    return MOEAD(directions, **settings) if name == "MOEA/D" else NSGA3(directions, pop_size=len(first), **settings)


OURS, ONE_LINE = "MaxiMinNSGA2", "NSGA2(survival=MaxiMin())"
CROWDING, HYPERVOLUME = "NSGA-II", "SMS-EMOA"  # the peers of the goals
LEFT_OUT = (
    "NSGA-II, pcd with more than two objectives, where it crashes",
    "SMS-EMOA with five objectives, where one generation takes seconds",
    "MOEA/D with constraints, which pymoo's refuses",
)


def methods_of(case: Case) -> list[str]:
    """Return the names of all methods that can run on a case, ours first."""
    without = {"NSGA-II, pcd": case.n_obj > 2, HYPERVOLUME: case.n_obj == 5, "MOEA/D": case.constrained}
    peers = [name for name in (PEERS if case.peers is None else case.peers) if not without.get(name, False)]
    return [OURS, ONE_LINE, *peers]


def first_genes(problem: Any, case: Case, seed: int) -> Genes:
    """Return the first population of a seed, the same for every method."""
    size = POPULATION[case.n_obj]
    rng = np.random.default_rng([seed, size])
    if has_real_genes(problem) and not case.binary:
        return seeded_population(problem, size, rng=rng)
    genes: Genes = BinaryRandomSampling().do(problem, size, random_state=rng).get("X")
    return genes


def algorithm(name: str, case: Case, problem: Any, first: Genes) -> Any:
    """Return a new algorithm that starts from ``first``."""
    size = len(first)
    if name == OURS:
        return MaxiMinNSGA2(pop_size=size, sampling=first)
    binary = {"crossover": TwoPointCrossover(), "mutation": BitflipMutation()}  # pymoo's defaults are for real genes
    operators = {} if has_real_genes(problem) and not case.binary else binary
    if name == ONE_LINE:
        return NSGA2(pop_size=size, sampling=first, survival=MaxiMin(), **operators)
    return pymoo_algorithm(name, case.n_obj, first, **operators)


WARM_UP = {2: "ZDT1", 3: "DTLZ2-3", 5: "DTLZ2-5"}  # by objectives: problems on which every peer can run


@dataclass(frozen=True)
class Run:
    """The result of a run: its final non-dominated objectives (points, n_obj) and its CPU seconds."""

    F: Objectives
    seconds: float


def run_once(case_name: str, name: str, seed: int, generations: int) -> Run:
    """Run one method once, after a warm-up; by names so that it can run in another process."""
    case = cases()[case_name]
    for each in (WARM_UP[case.n_obj], case_name):
        _warm_up(each, name)
    return _run(case, name, seed, generations)


@cache
def _warm_up(case_name: str, name: str) -> None:
    """Compile and load everything that a method and a problem need, in this process, before they are timed."""
    _run(cases()[case_name], name, 0, 3)


def _run(case: Case, name: str, seed: int, generations: int) -> Run:
    problem = problem_of(case.name)
    first = first_genes(problem, case, seed)
    method = algorithm(name, case, problem, first)
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own warnings about divisions
        result = minimize(problem, method, ("n_eval", len(first) * generations), seed=seed)
    seconds = time.process_time() - started
    F = np.empty((0, case.n_obj)) if result.F is None else np.atleast_2d(result.F)
    F = F[np.isfinite(F).all(axis=1)]
    if case.highest is not None:
        F = F[np.less_equal(F, case.highest).all(axis=1)]
    return Run(union([F]), seconds)


@cache
def _digest_of_search() -> str:
    sources = sorted(Path(paretoik.search.__path__[0]).rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]


LIMIT = 600.0  # seconds after which a run, which takes about ten, counts as empty


Runs: TypeAlias = dict[tuple[str, str], list[Run]]  # of every seed by problem and method


def run_all(chosen: Sequence[Case], seeds: int, folder: Path | None = None, *, cluster: str | None = None) -> Runs:
    """Run every method on every case, seeds outermost, the order of methods rotating; read runs in ``folder``."""
    shape = {case.name: (case.generations, case.n_obj) for case in chosen}

    def arguments(seed: int) -> dict[tuple[str, str], list[Any]]:
        return {
            (case.name, name): [case.name, name, seed, case.generations]
            for case in chosen
            for name in rotated(methods_of(case), seed)
        }

    def file(key: tuple[str, str], seed: int) -> Path | None:
        """Return the file of a run; a change of our search, or of pymoo's version, changes the file."""
        case_name, name = key
        made_by = f"search_{_digest_of_search()}" if name in (OURS, ONE_LINE) else f"pymoo_{pymoo.__version__}"
        method = "".join(letter if letter.isalnum() else "_" for letter in name)
        place = Path(made_by) / case_name.replace(" ", "_") / f"{method}_{shape[case_name][0]}_{seed}.npz"
        return None if folder is None else folder / place

    def load(key: tuple[str, str], seed: int) -> Run | None:
        place = file(key, seed)
        if place is None or not place.exists():
            return None
        with np.load(place, allow_pickle=False) as stored:
            return Run(stored["F"], float(stored["seconds"]))

    def save(key: tuple[str, str], seed: int, result: Run) -> None:
        place = file(key, seed)
        if place is not None:  # a process killed meanwhile leaves no half-written file
            replace_file(place, array_bytes({"F": result.F, "seconds": np.array(result.seconds)}))

    def empty(key: tuple[str, str]) -> Run:
        return Run(np.empty((0, shape[key[0]][1])), LIMIT)

    with processes(cluster) as executor:
        return run_seeds(executor, run_once, arguments, seeds, limit=LIMIT, empty=empty, load=load, save=save)


TABLE = "{} compared with its peers, medians (hypervolume: more is better; IGD+, epsilon: less)"
COUNTED = "wins and losses of {} over problems and indicators"
GOALS = "goals"
COST = "median CPU time of a run, at equal evaluations"
SHARE = 0.5  # of the problems with two objectives


Comparisons: TypeAlias = dict[str, list[Comparison]]  # of each of ours with every peer, losses first
Seconds: TypeAlias = dict[tuple[str, str], float]  # median CPU seconds by problem and method


def judge(runs: Runs, chosen: Sequence[Case]) -> Comparisons:
    """Score all runs and compare each of ours with every peer, and the first with all; Holm for each of ours."""
    rows: Comparisons = {OURS: [], ONE_LINE: []}
    without = {OURS: {OURS}, ONE_LINE: {OURS, ONE_LINE}}  # methods that each is not compared with
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
    return {own: decide(each) for own, each in rows.items()}


def table_rows(runs: Runs, chosen: Sequence[Case]) -> list[Row]:
    """Return all comparisons, a table for each of ours; their count by peer; the cost of every method; the goals."""
    judged = judge(runs, chosen)
    seconds = {key: float(np.median([one.seconds for one in each])) for key, each in runs.items()}
    rows, tallies, costs, goals = list[Row](), list[Row](), list[Row](), list[Row]()
    for own, decided in judged.items():
        rows += [comparison_row(TABLE.format(own), one, one.verdict) for one in decided]
        tallies += tally_rows(COUNTED.format(own), decided, lambda one: one.peer)
        goals += goal_rows(own, decided, seconds, {case.name for case in chosen if case.n_obj == 2})
    for case in chosen:
        note = f"{POPULATION[case.n_obj] * case.generations} evaluations"
        costs += [Row(COST, case.name, name, "s", seconds[case.name, name], note=note) for name in methods_of(case)]
    return [*rows, *tallies, *costs, *goals]


def goal_rows(own: str, decided: Sequence[Comparison], seconds: Seconds, two: Collection[str]) -> Iterator[Row]:
    """Yield the goals of one of ours, against peers that ran; ``two`` are the problems with two objectives."""

    def count(some: Sequence[Comparison], word: str) -> int:
        return sum(one.verdict.startswith(word) for one in some)

    # No significant loss to crowding on any problem, in any indicator.
    if some := [one for one in decided if one.peer == CROWDING]:
        lost, undecided = count(some, "loss"), count(some, "undecided")
        verdict = "NOT MET" if lost else "met" if undecided < len(some) else "UNDECIDED"  # by too few seeds
        note = f"{verdict}: of {len(some)} comparisons {count(some, 'win')} won, {undecided} undecided" + "".join(
            f"; {one.problem} {one.indicator}: {one.verdict}" for one in some if one.verdict.startswith("loss")
        )
        yield Row(GOALS, own, f"significant losses to {CROWDING}", "", lost, reference=0, source="goal", note=note)
    # Ahead in median hypervolume on at least half of the problems with two objectives, in no more time.
    volumes = [one for one in decided if one.peer == HYPERVOLUME and one.indicator == "hypervolume"]
    if some := [one for one in volumes if one.problem in two]:
        times = [seconds[one.problem, own] / seconds[one.problem, HYPERVOLUME] for one in some]
        ahead = [one.ours > one.theirs and ratio <= 1.0 for one, ratio in zip(some, times, strict=True)]
        share = float(np.mean(ahead))
        note = f"{'met' if share >= SHARE else 'NOT MET'}: {sum(ahead)} of {len(ahead)}"
        note += f"; significantly ahead in {count(some, 'win')}, behind in {count(some, 'loss')}"
        note += f"; {min(times):.2f} to {max(times):.2f} of its time, median {np.median(times):.2f}"
        what = f"share of two-objective problems ahead of {HYPERVOLUME} in hypervolume at no more time"
        yield Row(GOALS, own, what, "", share, reference=SHARE, source="goal", note=note)


QUICK = {"ZDT1": 50, "ZDT5": 50, "DTLZ2-3": 40, "MW3": 50, "steep tail": 50}


def choose_cases(names: Sequence[str], *, quick: bool) -> list[Case]:
    """Choose cases by their names or families and, for --quick, shorten them."""
    every = cases()
    families = list(dict.fromkeys(case.family for case in every.values()))
    unknown = sorted(set(names) - set(every) - set(families))
    if unknown:
        wish = f"some of {', '.join(families)}, or of their problems' names such as {next(iter(every))}"
        raise SystemExit(f"--problems must be {wish}, got {', '.join(unknown)}")
    selected = set(names or (QUICK if quick else every))
    chosen = [case for case in every.values() if {case.name, case.family} & selected]
    return [replace(case, generations=QUICK.get(case.name, 50)) for case in chosen] if quick else chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__, quick="five problems, few generations, 11 seeds", cluster="all runs")
    parser.add_argument("--seeds", type=int, help="runs of each method (31; 11 with --quick)")
    parser.add_argument("--problems", nargs="+", default=[], metavar="NAME", help="only these problems or families")
    beside = parser.add_mutually_exclusive_group()
    beside.add_argument("--goals", action="store_true", help=f"against {CROWDING} and {HYPERVOLUME} only")
    beside.add_argument("--peers", nargs="+", choices=PEERS, metavar="NAME", help=f"only some of {', '.join(PEERS)}")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="store every run here, and read the stored ones")
    options = parser.parse_args(arguments)
    seeds = options.seeds if options.seeds is not None else (11 if options.quick else 31)
    if seeds < 2:
        parser.error(f"--seeds must be at least 2, got {seeds}")
    chosen = choose_cases(options.problems, quick=options.quick)
    peers = (CROWDING, HYPERVOLUME) if options.goals else options.peers
    if peers is not None:
        chosen = [replace(case, peers=tuple(peers)) for case in chosen]
    if options.quick:
        print(f"quick: {', '.join(f'{case.name} {case.generations} generations' for case in chosen)} only")
    missing = [] if COCO else [f"{BIOBJECTIVE}, whose package coco-experiment is not installed"]
    print("\n".join(f"left out: {what}" for what in (*LEFT_OUT, *missing)))
    runs = run_all(chosen, seeds, options.runs, cluster=options.cluster)
    if min((len(each) for each in runs.values()), default=0) < 2:
        parser.exit(1, "interrupted before two seeds were done: nothing to judge\n")
    report(table_rows(runs, chosen), json_file=options.json)


if __name__ == "__main__":
    from studies.benchmarks.maximin import main as named_main  # workers know its functions by this name

    named_main()
