"""Crossover and mutation for genes that are coordinates of one smooth thing, such as the coefficients of a spline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation

from paretoik.search.constraints import Floats


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
