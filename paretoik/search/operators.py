"""The genetic algorithm of Marcos et al. 2012 (4.1, 4.2): genes crossed row by row, one replaced, an elite of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.core.selection import Selection
from pymoo.core.survival import Survival

from paretoik.arrays import Genes
from paretoik.search.genes import seeded_population
from paretoik.search.maximin import column
from paretoik.search.objectives import Floats, Integers

# Crossover and mutation for genes that are coordinates of one smooth thing, such as the coefficients of a spline.


@dataclass(frozen=True, kw_only=True)
class VariationOptions:
    """Settings of crossover and mutation of smooth genes; chosen here."""

    factors: tuple[float, ...] = (0.3, 0.6, 1.0)  # of the difference that crossover adds
    widths: tuple[float, float] = (0.5, 8.0)  # genes: standard deviation of a bump, evenly drawn in its logarithm
    amplitudes: tuple[float, float] = (0.003, 0.2)  # of a gene's range: of a bump, likewise


OPTIONS = VariationOptions()


class Differential(Crossover):  # type: ignore[misc]  # pymoo has no types
    """One offspring of three parents: the first, plus a share of the difference of the other two.

    Such steps have the size and the shape of the population itself, however badly genes are scaled to each other.
    Source: Storn & Price 1997; with NSGA-II's selection as in Robic & Filipic 2005.
    """

    def __init__(self) -> None:
        super().__init__(3, 1, prob=1.0)

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        step = random_state.choice(OPTIONS.factors, size=(X.shape[1], 1))
        offspring: Floats = np.clip(X[0] + step * (X[1] - X[2]), problem.xl, problem.xu)
        return offspring[None]


class SmoothMutation(Mutation):  # type: ignore[misc]  # pymoo has no types
    """A bump over neighbouring genes: a Gaussian of random place, width and size is added to one row of ``row`` genes.

    The last genes of an individual are taken as rows of that length; genes before them are left alone.
    """

    def __init__(self, row: int, *, prob: float = 0.8) -> None:
        super().__init__(prob=prob)
        self.row = row

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        count, rows = len(X), problem.n_var // self.row
        place = random_state.uniform(0, self.row - 1, (count, 1))
        width = _log_uniform(OPTIONS.widths, count, random_state)
        size = _log_uniform(OPTIONS.amplitudes, count, random_state) * random_state.normal(size=(count, 1))
        bump = size * np.exp(-(((np.arange(self.row) - place) / width) ** 2))
        row = random_state.integers(rows, size=count)
        first = problem.n_var - rows * self.row
        genes = first + row[:, None] * self.row + np.arange(self.row)
        offspring: Floats = X.copy()
        span = (problem.xu - problem.xl)[genes]
        np.put_along_axis(offspring, genes, np.take_along_axis(offspring, genes, axis=1) + bump * span / 2, axis=1)
        return np.clip(offspring, problem.xl, problem.xu)


def _log_uniform(bounds: tuple[float, float], count: int, rng: np.random.Generator) -> Floats:
    samples: Floats = np.exp(rng.uniform(np.log(bounds[0]), np.log(bounds[1]), size=(count, 1)))
    return samples


def elitist_algorithm(population: int, *, offspring: int | None = None, initial: Genes | None = None) -> Any:
    """Return the algorithm of section 4.2, of one objective; ``initial`` genes (rows, genes) are in its population.

    Rank weighting, single-point crossover, one gene replaced, an elite of one.
    """
    return GeneticAlgorithm(
        pop_size=population,
        n_offsprings=offspring,
        sampling=Seeded(initial),
        selection=RankWeighting(),
        crossover=RowCrossover(),
        mutation=ReplaceOne(),
        survival=OneElite(),
        eliminate_duplicates=False,
    )


class Seeded(Sampling):  # type: ignore[misc]  # pymoo has no types
    """The ``initial`` genes, if any, and others at random."""

    def __init__(self, initial: Genes | None) -> None:
        super().__init__()
        self.initial = initial

    def _do(self, problem: Any, n_samples: int, *, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        return seeded_population(problem, n_samples, self.initial, rng=random_state)


class RowCrossover(Crossover):  # type: ignore[misc]  # pymoo has no types
    """Single-point crossover of every row of ``row`` genes: two parents exchange the genes behind a point of its own.

    A row of one gene is exchanged whole or not at all. None is a row of all genes.
    """

    def __init__(self, row: int | None = None, *, prob: float = 0.5) -> None:
        super().__init__(2, 2, prob=prob)
        self.row = row

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        _, matings, size = X.shape
        row = size if self.row is None else self.row
        rows = X.reshape(2, matings, size // row, row)
        cut = random_state.integers(1, max(row, 2), size=(matings, size // row, 1))
        behind = np.arange(row) >= (cut if row > 1 else cut - random_state.integers(0, 2, size=cut.shape))
        return np.where(behind, rows[::-1], rows).reshape(X.shape)


class ReplaceOne(Mutation):  # type: ignore[misc]  # pymoo has no types
    """One gene, drawn at random, is replaced with a value drawn uniformly from its bounds."""

    def __init__(self, *, prob: float = 0.5) -> None:
        super().__init__(prob=prob)

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        gene = random_state.integers(X.shape[1], size=len(X))
        made: Floats = X.copy()
        made[np.arange(len(X)), gene] = random_state.uniform(problem.xl[gene], problem.xu[gene])
        return made


class BinaryTournament(Selection):  # type: ignore[misc]  # pymoo has no types
    """Of two individuals drawn with repetition the better: by rank, then by insertion distance, then by chance."""

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        rank = np.array([individual.data["rank"] for individual in pop])
        distance = np.array([individual.data["insertion_distance"] for individual in pop])
        first, second = random_state.integers(len(pop), size=(2, *shape))
        better = (rank[first] < rank[second]) | ((rank[first] == rank[second]) & (distance[first] >= distance[second]))
        chosen: Integers = np.where(better, first, second)
        return chosen


class RankWeighting(Selection):  # type: ignore[misc]  # pymoo has no types
    """Of a single objective: the k-th best of N is drawn with chance 2 (N − k + 1) / (N (N + 1)).

    Source: Haupt & Haupt 2004, section 2.2.4, rank weighting.
    """

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        share = np.arange(len(pop), 0, -1) / (len(pop) * (len(pop) + 1) / 2)
        drawn: Integers = _best_first(pop)[random_state.choice(len(pop), size=shape, p=share)]
        return drawn


class OneElite(Survival):  # type: ignore[misc]  # pymoo has no types
    """The offspring replace their parents, but the best parent stays in place of the worst of them."""

    def __init__(self) -> None:
        super().__init__(filter_infeasible=False)

    def _do(self, problem: Any, pop: Any, *args: Any, n_survive: int, **kwargs: Any) -> Any:
        if len(pop) <= n_survive:
            return pop
        parents, offspring = pop[:n_survive], pop[n_survive:]
        stay = max(1, n_survive - len(offspring))  # one, but where there are fewer offspring than parents
        survivors = np.sort(_best_first(offspring)[: n_survive - stay])
        return Population.merge(parents[_best_first(parents)[:stay]], offspring[survivors])


def _best_first(pop: Any) -> Integers:
    order: Integers = np.lexsort((column(pop, "F")[:, 0], column(pop, "CV")[:, 0]))
    return order
