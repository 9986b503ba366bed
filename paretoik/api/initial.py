"""Initial solutions (genes, motions or a former front), as genes and as points of a program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.arrays import Genes, Points
from paretoik.errors import InvalidInput, warn_user
from paretoik.formulations.protocol import ProblemParts
from paretoik.front.front import Front
from paretoik.pareto.differentiable import Differentiable
from paretoik.runs.fingerprint import fingerprint
from paretoik.runs.journal import key_of, recalled, remembered
from paretoik.search.genes import checked_genes
from paretoik.task.motion import Motion

INITIAL = key_of("initial")  # key of the initial solutions in the journal of a run
MISSED = 1e-6  # deviation of genes from a motion that a warning names [rad, m]


def initial_genes(problem: Any, initial: Genes | Motion | Front | None) -> Genes | None:
    """Return genes (rows, n_var) of initial solutions; warn of motions that the genes miss.

    Raises InvalidInput for motions that the problem cannot encode, and a front of another problem without any.
    """
    if isinstance(initial, Front):
        if initial.genes is not None and initial.provenance.get("fingerprint") == fingerprint(problem):
            return np.array(initial.genes)
        if initial.motions is None:
            raise InvalidInput("initial must be a front with motions or of this problem, got neither")
        initial = initial.motions  # type: ignore[assignment]  # a front of motions holds Motion
    if initial is None or isinstance(initial, np.ndarray | list):
        return initial
    if not isinstance(initial, Motion):
        raise InvalidInput(f"initial must be genes, motions or a front, got {type(initial).__name__}")
    genes, deviation = ProblemParts(problem).encode(initial)
    inexact = deviation > MISSED
    if inexact.any():
        warn_user(
            f"initial: {inexact.sum()} of {len(genes)} motions start approximately; the genes miss them by up to "
            f"{deviation.max():.2g} rad (or m)",
        )
    return genes


def initial_points(formulation: Differentiable, initial: Genes | Motion | Front | None) -> Points | None:
    """Return initial solutions as points of a formulation's program, or None; raises InvalidInput for others."""
    if initial is None:
        return None
    if isinstance(initial, Front):
        if tuple(initial.names) != tuple(formulation.names):
            raise InvalidInput(f"initial must be a front of {', '.join(formulation.names)}, got another")
        return formulation.front_points(initial)
    if isinstance(initial, Motion):
        return formulation.motion_points(initial)
    if not isinstance(initial, np.ndarray | list):
        raise InvalidInput(f"initial must be genes, motions or a front, got {type(initial).__name__}")
    return formulation.points(checked_genes(formulation, initial))


def remembered_points(x: Points | None) -> Points | None:
    """Return initial points; for a resumed run the original ones."""
    return remembered(INITIAL, lambda: {} if x is None else {"x": x}).get("x")


def remembered_motions(problem: Any, motions: Motion | None) -> Motion | None:
    """Return initial motions; for a resumed run the original ones."""
    values = remembered(INITIAL, lambda: {"q": problem.motion_points(motions)} if isinstance(motions, Motion) else {})
    return motions if motions is not None or "q" not in values else problem.task.motion(values["q"])


@dataclass(frozen=True, kw_only=True, eq=False)
class InitialSolutions:
    """The ``genes`` (rows, n_var) of a search's initial solutions, and the exact ``points`` of motions, if any."""

    genes: Genes | None
    points: Points | None

    @classmethod
    def of(cls, problem: Any, initial: Genes | Motion | Front | None) -> InitialSolutions:
        """Return the initial solutions; for a resumed run the original ones."""
        values = recalled(INITIAL)
        if values is not None:
            return cls(genes=values.get("genes"), points=values.get("points"))
        genes = initial_genes(problem, initial)
        has_motions = initial.motions is not None if isinstance(initial, Front) else isinstance(initial, Motion)
        points = initial_points(problem, initial) if has_motions and isinstance(problem, Differentiable) else None
        return cls(genes=None if genes is None else checked_genes(problem, genes), points=points)

    def remember(self) -> None:
        """Write the solutions into the run's journal, if it has one."""
        arrays = {"genes": self.genes, "points": self.points}
        remembered(INITIAL, lambda: {name: array for name, array in arrays.items() if array is not None})
