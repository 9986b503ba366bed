"""Genes of any kind: real numbers, with bounds or without, and those that pymoo's own operators sample and vary.

How far to look along a gene without a finite bound, populations say: beyond where they are, by how wide they were.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from jaxtyping import Float
from pymoo.algorithms.moo.nsga2 import binary_tournament
from pymoo.core.duplicate import DefaultDuplicateElimination
from pymoo.core.mating import Mating
from pymoo.core.mixed import MixedVariableDuplicateElimination, MixedVariableMating, MixedVariableSampling
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.operators.crossover.pntx import TwoPointCrossover
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.bitflip import BitflipMutation
from pymoo.operators.mutation.pm import PM
from pymoo.operators.repair.rounding import RoundingRepair
from pymoo.operators.sampling.rnd import BinaryRandomSampling, IntegerRandomSampling
from pymoo.operators.selection.tournament import TournamentSelection

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.inputs import shown


@dataclass(frozen=True, kw_only=True)
class VariableOptions:
    """Distribution indices η of SBX and of polynomial mutation for integers, as pymoo has them; chosen there."""

    crossover_index: float = 3.0
    mutation_index: float = 3.0
    crossover_probability: float = 0.9


OPTIONS = VariableOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Operators:
    """pymoo's operators for a kind of genes: how a first population is sampled, and how the next are mated."""

    sampling: Any
    mating: Any
    duplicates: Any


def has_real_genes(problem: Any) -> bool:
    """Return whether the genes of a pymoo problem are an array of real numbers."""
    return getattr(problem, "vars", None) is None and problem.vtype in (None, float)


def check_sampling(sampling: Any) -> None:
    """Raise InvalidInput unless a first population can start with this: genes, individuals or a sampling of pymoo's."""
    if sampling is None or isinstance(sampling, Sampling | Population) or _are_named(sampling):
        return
    try:
        genes = np.asarray(sampling)
    except Exception:  # a foreign array may raise anything
        genes = np.array("")
    is_usable = genes.dtype.kind in "biuf" and genes.ndim in (1, 2) and not np.isnan(genes).any()
    if not is_usable or np.ma.is_masked(sampling):
        raise InvalidInput(f"sampling: genes, a Population or a Sampling of pymoo's wanted, got {shown(sampling)}")


def _are_named(genes: Any) -> bool:
    """Say whether genes are rows of variables by name."""
    return isinstance(genes, list | np.ndarray) and len(genes) > 0 and all(isinstance(row, dict) for row in genes)


def samples_bits(sampling: Any) -> bool:
    """Return whether what a first population starts with is binary: pymoo's ZDT5 for one calls its genes real."""
    genes = sampling.get("X") if isinstance(sampling, Population) else sampling
    return isinstance(sampling, BinaryRandomSampling) or (isinstance(genes, np.ndarray) and genes.dtype == bool)


def bounds_of(problem: Any) -> tuple[Float[np.ndarray, " genes"], Float[np.ndarray, " genes"]]:
    """Return the bounds of real genes, infinite where there is none."""
    sides = ((problem.xl, -np.inf), (problem.xu, np.inf))
    lower, upper = (np.full(problem.n_var, none) if side is None else np.asarray(side, float) for side, none in sides)
    return lower, upper


def widths_of(X: Genes) -> Float[np.ndarray, " genes"]:
    """Return how wide a population is along every gene; where all have one value, its size or 1."""
    low, high = X.min(axis=0), X.max(axis=0)
    return np.asarray(np.where(high > low, high - low, np.maximum(np.abs(high), 1.0)))


def within_reach(problem: Any, X: Genes, widths: Float[np.ndarray, " genes"]) -> Any:
    """Return a problem for operators of real genes, whose bounds are finite: else so far beyond X as ``widths`` say."""
    lower, upper = bounds_of(problem)
    if np.isfinite(lower).all() and np.isfinite(upper).all():
        return problem
    xl = np.where(np.isfinite(lower), lower, X.min(axis=0) - widths)
    xu = np.where(np.isfinite(upper), upper, X.max(axis=0) + widths)
    return SimpleNamespace(n_var=problem.n_var, xl=xl, xu=xu, bounds=lambda: (xl, xu), has_bounds=lambda: True)


def operators_for(problem: Any, crossover: Any = None, mutation: Any = None, *, binary: bool = False) -> Operators:
    """Return pymoo's operators for genes that are no real numbers, but for those that are given.

    They are ``binary`` whatever the problem calls them, or what it does. Raises InvalidInput where pymoo has none for
    such genes and none are given.
    """
    selection = TournamentSelection(func_comp=binary_tournament)
    if getattr(problem, "vars", None) is not None:
        if crossover is not None or mutation is not None:
            name = "crossover" if crossover is not None else "mutation"
            raise InvalidInput(f"{name}: none wanted for named variables, pymoo has one for each type, got {name}=")
        duplicates = MixedVariableDuplicateElimination()
        mating = MixedVariableMating(selection=selection, eliminate_duplicates=duplicates)
        return Operators(sampling=MixedVariableSampling(), mating=mating, duplicates=duplicates)
    sampling = None
    if binary or np.issubdtype(problem.vtype, np.bool_):
        sampling = BinaryRandomSampling()
        crossover, mutation = crossover or TwoPointCrossover(), mutation or BitflipMutation()
    elif np.issubdtype(problem.vtype, np.integer):
        sampling, real = IntegerRandomSampling(), {"vtype": float, "repair": RoundingRepair()}
        crossover = crossover or SBX(prob=OPTIONS.crossover_probability, eta=OPTIONS.crossover_index, **real)
        mutation = mutation or PM(eta=OPTIONS.mutation_index, **real)
    elif crossover is None or mutation is None:
        name = "crossover" if crossover is None else "mutation"
        raise InvalidInput(f"{name}: a pymoo operator for genes of type {problem.vtype} wanted, got none")
    duplicates = DefaultDuplicateElimination()
    mating = Mating(selection, crossover, mutation, eliminate_duplicates=duplicates)
    return Operators(sampling=sampling, mating=mating, duplicates=duplicates)
