"""Operators for smooth genes, and the genetic algorithm of Marcos et al. 2012 (sections 4.1 and 4.2)."""

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

# Crossover and mutation for genes that describe one smooth function, such as the coefficients of a spline.


@dataclass(frozen=True, kw_only=True)
class VariationOptions:
    """Settings of crossover and mutation of smooth genes; they have no source."""

    factors: tuple[float, ...] = (0.3, 0.6, 1.0)  # shares of the difference that crossover adds
    widths: tuple[float, float] = (0.5, 8.0)  # number of genes: width of a bump, log-uniform
    amplitudes: tuple[float, float] = (0.003, 0.2)  # share of a gene's range: size of a bump, log-uniform


OPTIONS = VariationOptions()


class Differential(Crossover):  # type: ignore[misc]  # pymoo has no types
    """One offspring of three parents: the first plus a share of the difference of the other two.

    Steps follow the spread of the population, even if genes are badly scaled.
    Source: Storn & Price 1997; with NSGA-II's selection as in Robic & Filipic 2005.
    """

    def __init__(self) -> None:
        super().__init__(3, 1, prob=1.0)

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        step = random_state.choice(OPTIONS.factors, size=(X.shape[1], 1))
        offspring: Floats = np.clip(X[0] + step * (X[1] - X[2]), problem.xl, problem.xu)
        return offspring[None]


class SmoothMutation(Mutation):  # type: ignore[misc]  # pymoo has no types
    """A bump over neighbouring genes: adds a Gaussian of random place, width and size to one row of genes.

    The last genes of an individual are rows of length ``row``; genes before them do not change.
    """

    def __init__(self, row: int) -> None:
        super().__init__(prob=0.8)
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


# The genetic algorithm of Marcos et al. 2012.


def elitist_algorithm(population: int, *, offspring: int | None = None, initial: Genes | None = None) -> Any:
    """Return the algorithm of section 4.2 for one objective; its population includes ``initial`` (rows, genes).

    It has rank weighting, single-point crossover, replacement of one gene, and an elite of one.
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
    """The ``initial`` genes, if any, and random ones."""

    def __init__(self, initial: Genes | None) -> None:
        super().__init__()
        self.initial = initial

    def _do(self, problem: Any, n_samples: int, *, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        return seeded_population(problem, n_samples, self.initial, rng=random_state)


class RowCrossover(Crossover):  # type: ignore[misc]  # pymoo has no types
    """Single-point crossover in every row of genes: two parents exchange the genes behind the row's point.

    row: number of genes per row; None: all genes. A row of one gene is exchanged or not.
    """

    def __init__(self, row: int | None = None) -> None:
        super().__init__(2, 2, prob=0.5)
        self.row = row

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        _, matings, size = X.shape
        row = size if self.row is None else self.row
        rows = X.reshape(2, matings, size // row, row)
        cut = random_state.integers(1, max(row, 2), size=(matings, size // row, 1))
        behind = np.arange(row) >= (cut if row > 1 else cut - random_state.integers(0, 2, size=cut.shape))
        return np.where(behind, rows[::-1], rows).reshape(X.shape)


class ReplaceOne(Mutation):  # type: ignore[misc]  # pymoo has no types
    """Replaces one random gene with a value that is uniform between its bounds."""

    def __init__(self) -> None:
        super().__init__(prob=0.5)

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        gene = random_state.integers(X.shape[1], size=len(X))
        made: Floats = X.copy()
        made[np.arange(len(X)), gene] = random_state.uniform(problem.xl[gene], problem.xu[gene])
        return made


class BinaryTournament(Selection):  # type: ignore[misc]  # pymoo has no types
    """The better of two random individuals: by rank, then insertion distance; the first if equal."""

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        rank = np.array([individual.data["rank"] for individual in pop])
        distance = np.array([individual.data["insertion_distance"] for individual in pop])
        first, second = random_state.integers(len(pop), size=(2, *shape))
        better = (rank[first] < rank[second]) | ((rank[first] == rank[second]) & (distance[first] >= distance[second]))
        chosen: Integers = np.where(better, first, second)
        return chosen


class RankWeighting(Selection):  # type: ignore[misc]  # pymoo has no types
    """Selection by rank, for one objective.

    The k-th best of N is selected with probability 2 (N − k + 1) / (N (N + 1)).
    Source: Haupt & Haupt 2004, section 2.2.4, rank weighting.
    """

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        share = np.arange(len(pop), 0, -1) / (len(pop) * (len(pop) + 1) / 2)
        drawn: Integers = _best_first(pop)[random_state.choice(len(pop), size=shape, p=share)]
        return drawn


class OneElite(Survival):  # type: ignore[misc]  # pymoo has no types
    """The offspring replace their parents, but the best parent replaces the worst offspring."""

    def __init__(self) -> None:
        super().__init__(filter_infeasible=False)

    def _do(self, problem: Any, pop: Any, *args: Any, n_survive: int, **kwargs: Any) -> Any:
        if len(pop) <= n_survive:
            return pop
        parents, offspring = pop[:n_survive], pop[n_survive:]
        stay = max(1, n_survive - len(offspring))  # one, or more if there are fewer offspring than parents
        survivors = np.sort(_best_first(offspring)[: n_survive - stay])
        return Population.merge(parents[_best_first(parents)[:stay]], offspring[survivors])


def _best_first(pop: Any) -> Integers:
    order: Integers = np.lexsort((column(pop, "F")[:, 0], column(pop, "CV")[:, 0]))
    return order
