"""Methods for a problem, pymoo's with their defaults, and their runs: one, stored ones, and all, interleaved."""

from __future__ import annotations

import hashlib
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pymoo
from pymoo.algorithms.moo.age import AGEMOEA
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.operators.crossover.pntx import TwoPointCrossover
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.sampling.rnd import BinaryRandomSampling
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.optimize import minimize
from pymoo.util.ref_dirs import get_reference_directions

import paretoik.search
from paretoik.arrays import Genes, Objectives
from paretoik.front.storage import array_bytes
from paretoik.runs.file_replacement import replace_file
from paretoik.search.genes import has_real_genes, seeded_population
from paretoik.search.maximin import MaxiMin
from paretoik.search.nsga2 import MaxiMinNSGA2
from studies.benchmarks.maximin.cases import POPULATION, Case, cases, problem_of
from studies.processes import processes, rotated, run_seeds
from studies.significance import union

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
BOXED = "MaxiMinNSGA2, ranges="
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
    return [OURS, ONE_LINE, *peers, *([BOXED] if case.box else [])]


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
    if name in (OURS, BOXED):
        return MaxiMinNSGA2(pop_size=size, sampling=first, ranges=case.box if name == BOXED else None)
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
    if case.box is not None:
        F = F[np.less_equal(F, case.box[1]).all(axis=1)]
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
        made_by = f"search_{_digest_of_search()}" if name in (OURS, ONE_LINE, BOXED) else f"pymoo_{pymoo.__version__}"
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
