"""The operators of Marcos et al. 2012 (sections 4.1 and 4.2): genes in rows, crossed row by row, one gene replaced."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.selection import Selection

from paretoik.search.constraints import Floats, Integers
from paretoik.search.maximin import column


class RowCrossover(Crossover):  # type: ignore[misc]  # pymoo has no types
    """Single-point crossover of every row of ``row`` genes: two parents exchange the genes behind a point of its own.

    A row of one gene is exchanged whole or not at all.
    """

    def __init__(self, row: int, *, prob: float = 0.5) -> None:
        super().__init__(2, 2, prob=prob)
        self.row = row

    def _do(self, problem: Any, X: Floats, *args: Any, random_state: np.random.Generator, **kwargs: Any) -> Floats:
        _, matings, size = X.shape
        rows = X.reshape(2, matings, size // self.row, self.row)
        cut = random_state.integers(1, max(self.row, 2), size=(matings, size // self.row, 1))
        behind = np.arange(self.row) >= (cut if self.row > 1 else cut - random_state.integers(0, 2, size=cut.shape))
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
        distance = np.array([individual.data["crowding"] for individual in pop])
        first, second = random_state.integers(len(pop), size=(2, *shape))
        better = (rank[first] < rank[second]) | ((rank[first] == rank[second]) & (distance[first] >= distance[second]))
        chosen: Integers = np.where(better, first, second)
        return chosen


class RankWeighting(Selection):  # type: ignore[misc]  # pymoo has no types
    """Of a single objective: the k-th best of N is drawn with chance 2 (N − k + 1) / (N (N + 1)).

    Source: Haupt & Haupt 2004, section 2.2.4, rank weighting.
    """

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        best_first = np.lexsort((column(pop, "F")[:, 0], column(pop, "CV")[:, 0]))
        share = np.arange(len(pop), 0, -1) / (len(pop) * (len(pop) + 1) / 2)
        drawn: Integers = best_first[random_state.choice(len(pop), size=shape, p=share)]
        return drawn
