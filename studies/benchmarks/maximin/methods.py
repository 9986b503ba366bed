"""Our two methods, and those of pymoo's algorithms that can run on a problem."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.operators.crossover.pntx import TwoPointCrossover
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.sampling.rnd import BinaryRandomSampling

from paretoik.arrays import Genes
from paretoik.search.genes import has_real_genes, seeded_population
from paretoik.search.maximin import MaxiMin
from paretoik.search.nsga2 import MaxiMinNSGA2
from studies.benchmarks.maximin.cases import POPULATION, Case
from studies.benchmarks.pymoo_peers import PEERS, pymoo_algorithm

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
