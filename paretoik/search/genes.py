"""Genes of any kind: real numbers with or without bounds, and types for pymoo's own operators.

If a gene has no finite bound, the search reaches one population width beyond the population's values.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
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
from paretoik.inputs import check_size, real_array, shown, user_function
from paretoik.search.objectives import Floats


@dataclass(frozen=True, kw_only=True)
class VariableOptions:
    """Distribution indices η of SBX and polynomial mutation for integers; pymoo's own defaults."""

    crossover_index: float = 3.0
    mutation_index: float = 3.0
    crossover_probability: float = 0.9


OPTIONS = VariableOptions()


def has_real_genes(problem: Any) -> bool:
    """Return whether the genes of a pymoo problem are an array of real numbers."""
    return getattr(problem, "vars", None) is None and problem.vtype in (None, float)


def check_sampling(sampling: Any) -> None:
    """Raise InvalidInput unless ``sampling`` is genes, individuals or a pymoo Sampling."""
    named = isinstance(sampling, list | np.ndarray) and len(sampling) and all(isinstance(row, dict) for row in sampling)
    if sampling is None or isinstance(sampling, Sampling | Population) or named:
        return
    try:
        genes = np.asarray(sampling)
    except Exception:  # another library's array may raise any error
        genes = np.array("")
    is_usable = genes.dtype.kind in "biuf" and genes.ndim in (1, 2) and not np.isnan(genes).any()
    if not is_usable or np.ma.is_masked(sampling):
        raise InvalidInput(f"sampling must be genes, a pymoo Population or a pymoo Sampling, got {shown(sampling)}")


def samples_bits(sampling: Any) -> bool:
    """Return whether the first population is binary, as in pymoo's ZDT5, which declares real genes."""
    genes = sampling.get("X") if isinstance(sampling, Population) else sampling
    return isinstance(sampling, BinaryRandomSampling) or (isinstance(genes, np.ndarray) and genes.dtype == bool)


def bounds_of(problem: Any) -> tuple[Float[np.ndarray, " genes"], Float[np.ndarray, " genes"]]:
    """Return the bounds of real genes; missing bounds are infinite."""
    sides = ((problem.xl, -np.inf), (problem.xu, np.inf))
    lower, upper = (np.full(problem.n_var, none) if side is None else np.asarray(side, float) for side, none in sides)
    return lower, upper


def widths_of(X: Genes) -> Float[np.ndarray, " genes"]:
    """Return the width of a population along every gene.

    If all values of a gene are equal, its width is the larger of their magnitude and 1.
    """
    low, high = X.min(axis=0), X.max(axis=0)
    return np.asarray(np.where(high > low, high - low, np.maximum(np.abs(high), 1.0)))


def within_reach(problem: Any, X: Genes, widths: Float[np.ndarray, " genes"]) -> Any:
    """Return a problem with finite bounds for operators of real genes.

    A missing bound is replaced by one that is ``widths`` beyond the genes X.
    """
    lower, upper = bounds_of(problem)
    if np.isfinite(lower).all() and np.isfinite(upper).all():
        return problem
    xl = np.where(np.isfinite(lower), lower, X.min(axis=0) - widths)
    xu = np.where(np.isfinite(upper), upper, X.max(axis=0) + widths)
    return SimpleNamespace(n_var=problem.n_var, xl=xl, xu=xu, bounds=lambda: (xl, xu), has_bounds=lambda: True)


def operators_for(problem: Any, crossover: Any, mutation: Any, *, binary: bool) -> tuple[Any, Any]:
    """Return pymoo's sampling and mating for genes that are not real numbers.

    Given operators replace pymoo's. Genes are binary if ``binary``, otherwise of the problem's type. Raises
    InvalidInput if an operator is neither given nor known to pymoo.
    """
    selection = TournamentSelection(func_comp=binary_tournament)
    if getattr(problem, "vars", None) is not None:
        if crossover is not None or mutation is not None:
            name = "crossover" if crossover is not None else "mutation"
            raise InvalidInput(f"{name} must be None for named variables, because pymoo has its own, got an operator")
        duplicates = MixedVariableDuplicateElimination()
        return MixedVariableSampling(), MixedVariableMating(selection=selection, eliminate_duplicates=duplicates)
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
        raise InvalidInput(f"{name} must be a pymoo operator for genes of type {problem.vtype}, got none")
    return sampling, Mating(selection, crossover, mutation, eliminate_duplicates=DefaultDuplicateElimination())


# First population: genes from the user, from the problem, and random ones.


SMALLEST_POPULATION = 4


def check_problem(problem: Any, *, initial: Any = None) -> None:
    """Raise InvalidInput unless the problem has an objective and real genes.

    Bounds must be ordered. They may be missing or infinite only if there are ``initial`` genes to start from.
    """
    check_sizes(problem)
    if not has_real_genes(problem):
        raise InvalidInput(
            f"problem genes must be real numbers, got {problem.vtype or 'named variables'}; "
            "pymoo.optimize.minimize with MaxiMinNSGA2 takes other genes"
        )
    check_bounds(problem, initial=initial)


def check_sizes(problem: Any) -> None:
    """Raise InvalidInput unless this is a pymoo problem with genes and objectives."""
    with user_function("problem must be a pymoo problem, got one whose attributes cannot be read: it", InvalidInput):
        if isinstance(problem, type) or not (hasattr(problem, "n_obj") and hasattr(problem, "n_var")):
            raise InvalidInput(f"problem must be a pymoo problem, such as Tracking, got {shown(problem)}")
        check_size("problem.n_var", problem.n_var, 1)
        check_size("problem.n_obj", problem.n_obj, 1)


def check_algorithm(algorithm: object) -> None:
    """Raise InvalidInput unless this is a pymoo algorithm or None."""
    if algorithm is not None and (isinstance(algorithm, type) or not hasattr(algorithm, "setup")):
        raise InvalidInput(f"algorithm must be a pymoo algorithm, such as MaxiMinNSGA2(), got {shown(algorithm)}")


def check_bounds(problem: Any, *, initial: Any = None) -> None:
    """Raise InvalidInput unless the bounds of real genes are ordered and finite.

    With ``initial`` genes, bounds may be missing or infinite.
    """
    for name in ("xl", "xu"):
        bound = getattr(problem, name)
        if bound is None:
            if initial is None:
                raise InvalidInput(
                    f"problem.{name} must have one bound per gene ({problem.n_var}), got none; give bounds or initial "
                    "genes"
                )
            continue
        if not isinstance(bound, np.ndarray) or bound.shape != (problem.n_var,):
            raise InvalidInput(
                f"problem.{name} must have one bound per gene ({problem.n_var}), got shape {np.shape(bound)}"
            )
        for gene in np.flatnonzero(np.isnan(bound) | (np.isinf(bound) & (initial is None))):
            raise InvalidInput(f"problem.{name}[{gene}] must be a finite bound, got {bound[gene]}")
    lower, upper = bounds_of(problem)
    for gene in np.flatnonzero(lower > upper):
        raise InvalidInput(f"problem bounds of gene {gene} must have xl <= xu, got {lower[gene]} > {upper[gene]}")


def checked_genes(problem: Any, genes: ArrayLike, name: str = "initial", *, tolerance: float = 1e-12) -> Floats:
    """Return genes (points, genes), clipped if they exceed bounds by at most ``tolerance`` of the range.

    Raises InvalidInput for a wrong shape, a NaN, or a gene that exceeds its bounds by more, with row and gene.
    """
    X = np.atleast_2d(real_array(name, genes))
    if X.ndim != 2 or X.shape[1] != problem.n_var:
        raise InvalidInput(f"{name} must be rows of {problem.n_var} genes, got shape {X.shape}")
    lower, upper = bounds_of(problem)
    width, largest = upper - lower, np.maximum(-lower, upper)
    slack = np.where(np.isfinite(width), np.maximum(tolerance * width, 4 * np.spacing(largest)), 0.0)
    inside = (lower - slack <= X) & (upper + slack >= X) & np.isfinite(X)
    for row, gene in np.argwhere(~inside):
        raise InvalidInput(
            f"{name}[{row}] must have gene {gene} between {lower[gene]} and {upper[gene]}, got {X[row, gene]}"
        )
    return np.clip(X, lower, upper)


def seeded_population(problem: Any, size: int, initial: ArrayLike | None = None, *, rng: np.random.Generator) -> Floats:
    """Return exactly ``size`` rows of genes: ``initial``, then the problem's own, then random ones in the bounds.

    ``problem.sample_starts(n, rng)`` and ``problem.self_motion_samples(n, rng)``, if the problem has them, each give up
    to a third. Equal rows are replaced; copies remain only if the bounds allow fewer than ``size`` different rows.
    """
    first = np.empty((0, problem.n_var)) if initial is None else checked_genes(problem, initial)
    if len(first) > size:
        raise InvalidInput(f"initial must have at most {size} rows (the population), got {len(first)}")
    rows: dict[bytes, Floats] = {}
    _add(rows, first, size)
    third = -(-size // 3)
    for source in ("sample_starts", "self_motion_samples"):
        if hasattr(problem, source) and len(rows) < size:
            genes = getattr(problem, source)(min(third, size - len(rows)), rng)
            _add(rows, checked_genes(problem, genes, f"problem.{source}"), min(size, len(rows) + third))
    known = np.array(list(rows.values())).reshape(-1, problem.n_var)
    reach = within_reach(problem, known, widths_of(known)) if len(known) else problem
    for _ in range(10):
        _add(rows, _uniform(reach, size - len(rows), rng), size)
    spare = _uniform(reach, size - len(rows), rng)
    return np.concatenate((np.array(list(rows.values())).reshape(-1, problem.n_var), spare))


def _uniform(problem: Any, count: int, rng: np.random.Generator) -> Floats:
    genes = problem.xl + rng.random((count, problem.n_var)) * (problem.xu - problem.xl)
    return np.clip(genes, problem.xl, problem.xu)


def _add(rows: dict[bytes, Floats], genes: Floats, capacity: int) -> None:
    for row in genes:
        if len(rows) >= capacity:
            return
        rows.setdefault((row + 0.0).tobytes(), row)  # + 0.0 makes -0.0 and 0.0 equal
