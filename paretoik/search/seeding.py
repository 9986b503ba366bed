"""The first population: genes from the user, from the problem, and at random."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from paretoik.errors import InvalidInput
from paretoik.inputs import check_size, real_array, shown
from paretoik.search.constraints import Floats
from paretoik.search.variables import bounds_of, has_real_genes, widths_of, within_reach
from paretoik.user_functions import user_function

SMALLEST_POPULATION = 4


def check_problem(problem: Any, *, initial: Any = None) -> None:
    """Raise InvalidInput unless the problem has real genes within ordered bounds, and an objective.

    Bounds may only be missing or infinite where there are ``initial`` genes to start from.
    """
    check_sizes(problem)
    if not has_real_genes(problem):
        raise InvalidInput(
            f"problem genes: real numbers wanted, got {problem.vtype or 'named variables'}; "
            "pymoo.optimize.minimize with MaxiMinNSGA2 takes others"
        )
    check_bounds(problem, initial=initial)


def check_sizes(problem: Any) -> None:
    """Raise InvalidInput unless this is a pymoo problem with genes and objectives."""
    with user_function("problem: a pymoo problem wanted, got one whose attributes cannot be read: it", InvalidInput):
        if isinstance(problem, type) or not (hasattr(problem, "n_obj") and hasattr(problem, "n_var")):
            raise InvalidInput(f"problem: a pymoo problem wanted, such as Tracking, got {shown(problem)}")
        check_size("problem.n_var", problem.n_var, 1)
        check_size("problem.n_obj", problem.n_obj, 1)


def check_algorithm(algorithm: object) -> None:
    """Raise InvalidInput unless this is a pymoo algorithm or None."""
    if algorithm is not None and (isinstance(algorithm, type) or not hasattr(algorithm, "setup")):
        raise InvalidInput(f"algorithm: a pymoo algorithm wanted, such as MaxiMinNSGA2(), got {shown(algorithm)}")


def check_bounds(problem: Any, *, initial: Any = None) -> None:
    """Raise InvalidInput unless the bounds of real genes are ordered, and finite or there are ``initial`` genes."""
    for name in ("xl", "xu"):
        bound = getattr(problem, name)
        if bound is None:
            if initial is None:
                raise InvalidInput(
                    f"problem.{name}: {problem.n_var} bounds wanted, one a gene, got none, nor genes to start from"
                )
            continue
        if not isinstance(bound, np.ndarray) or bound.shape != (problem.n_var,):
            raise InvalidInput(
                f"problem.{name}: {problem.n_var} bounds wanted, one a gene, got shape {np.shape(bound)}"
            )
        for gene in np.flatnonzero(np.isnan(bound) | (np.isinf(bound) & (initial is None))):
            raise InvalidInput(f"problem.{name}[{gene}]: a finite bound wanted, got {bound[gene]}")
    lower, upper = bounds_of(problem)
    for gene in np.flatnonzero(lower > upper):
        raise InvalidInput(f"problem bounds of gene {gene}: xl <= xu wanted, got {lower[gene]} > {upper[gene]}")


def checked_genes(problem: Any, genes: ArrayLike, name: str = "initial", *, tolerance: float = 1e-12) -> Floats:
    """Return genes (points, genes) inside the bounds; what is outside by ``tolerance`` of the range is clipped.

    Raises InvalidInput for a wrong shape, a NaN, or a gene outside its bounds by more than rounding, with row and gene.
    """
    X = np.atleast_2d(real_array(name, genes))
    if X.ndim != 2 or X.shape[1] != problem.n_var:
        raise InvalidInput(f"{name}: rows of {problem.n_var} genes wanted, got shape {X.shape}")
    lower, upper = bounds_of(problem)
    width, largest = upper - lower, np.maximum(-lower, upper)
    slack = np.where(np.isfinite(width), np.maximum(tolerance * width, 4 * np.spacing(largest)), 0.0)
    inside = (lower - slack <= X) & (upper + slack >= X) & np.isfinite(X)
    for row, gene in np.argwhere(~inside):
        raise InvalidInput(
            f"{name}[{row}]: gene {gene} between {lower[gene]} and {upper[gene]} wanted, got {X[row, gene]}"
        )
    return np.clip(X, lower, upper)


def seeded_population(problem: Any, size: int, initial: ArrayLike | None = None, *, rng: np.random.Generator) -> Floats:
    """Make exactly ``size`` rows of genes: ``initial`` first, then the problem's own, then uniform in the bounds.

    ``problem.sample_starts(n, rng)`` and ``problem.self_motion_samples(n, rng)``, where it has them, each fill up to a
    third. Equal rows are dropped and replaced; only a box too small for ``size`` different rows leaves copies.
    """
    first = np.empty((0, problem.n_var)) if initial is None else checked_genes(problem, initial)
    if len(first) > size:
        raise InvalidInput(f"initial: at most {size} rows wanted (the population), got {len(first)}")
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
