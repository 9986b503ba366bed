"""Convert initial solutions (genes, motions or a former front) into genes and points of a program."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.arrays import Genes, Points
from paretoik.errors import InvalidInput, warn_user
from paretoik.formulations.protocol import ProblemParts
from paretoik.front.front import Front
from paretoik.pareto.differentiable import Differentiable
from paretoik.runs.fingerprint import fingerprint
from paretoik.runs.journal import Values, key_of, recalled, remembered
from paretoik.search.genes import checked_genes
from paretoik.task.motion import Motion

INITIAL = key_of("initial")  # key of the initial solutions in the journal of a run


def initial_genes(problem: Any, initial: Genes | Motion | Front | None) -> Genes | None:
    """Return genes (rows, n_var) of initial solutions; warn if genes only approximate motions.

    Raises InvalidInput for motions that the problem cannot encode, and for another problem's front without motions.
    """
    if isinstance(initial, Front):
        if initial.genes is not None and initial.provenance.get("fingerprint") == fingerprint(problem):
            return np.array(initial.genes)
        if initial.motions is None:
            raise InvalidInput("initial must be a front of this problem, or one with motions, got neither")
        initial = initial.motions  # type: ignore[assignment]  # a front of motions holds Motion
    if initial is None or isinstance(initial, np.ndarray | list):
        return initial
    if not isinstance(initial, Motion):
        raise InvalidInput(f"initial must be genes, motions or a front, got {type(initial).__name__}")
    genes, deviation = ProblemParts(problem).encode(initial)
    inexact = deviation > 1e-6  # rad or m: a smaller deviation is not worth a warning
    if inexact.any():
        warn_user(
            f"initial: genes describe {inexact.sum()} of {len(genes)} motions only approximately; they differ by up to "
            f"{deviation.max():.2g} rad (or m)",
        )
    return genes


def initial_points(formulation: Differentiable, initial: Genes | Motion | Front | None) -> Points | None:
    """Return initial solutions as points of a formulation's program; None if there are none.

    Raises InvalidInput for solutions of another kind, or a front of other objectives.
    """
    if initial is None:
        return None
    if isinstance(initial, Front):
        if tuple(initial.names) != tuple(formulation.names):
            names, got = ", ".join(formulation.names), ", ".join(initial.names)
            raise InvalidInput(f"initial must be a front of {names}, got one of {got}")
        return formulation.front_points(initial)
    if isinstance(initial, Motion):
        return formulation.motion_points(initial)
    if not isinstance(initial, np.ndarray | list):
        raise InvalidInput(f"initial must be genes, motions or a front, got {type(initial).__name__}")
    return formulation.points(checked_genes(formulation, initial))


def remembered_initial(**arrays: np.ndarray | None) -> Values:
    """Return the arrays that are not None; for a resumed run the original ones, from its journal."""
    return remembered(INITIAL, lambda: {name: array for name, array in arrays.items() if array is not None})


def genes_and_points(problem: Any, initial: Genes | Motion | Front | None) -> dict[str, np.ndarray | None]:
    """Return the "genes" (rows, n_var) of a search's initial solutions, and exact "points" if these are motions.

    For a resumed run these are the original ones.
    """
    stored = recalled(INITIAL)
    if stored is not None:
        return {name: stored.get(name) for name in ("genes", "points")}
    genes = initial_genes(problem, initial)
    has_motions = initial.motions is not None if isinstance(initial, Front) else isinstance(initial, Motion)
    points = initial_points(problem, initial) if has_motions and isinstance(problem, Differentiable) else None
    return {"genes": None if genes is None else checked_genes(problem, genes), "points": points}
