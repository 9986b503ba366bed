"""Gradients that help a search on its way: a few iterations from points of its front, every few generations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.scalarisation import main_weights, minimise_weighted, ranges_of


@dataclass(frozen=True, kw_only=True)
class ImproverOptions:
    """When and how much: every so many generations (``every``), iterations up to ``share`` of all evaluations.

    The widest ``gaps`` are aimed at each time, with ``weight`` for the objectives that are not minimised there, and
    ``brief`` iterations a point.
    """

    every: int = 10
    share: float = 0.3
    gaps: int = 4
    weight: float = 1e-6
    brief: InteriorPointOptions = InteriorPointOptions(barrier=1e-2, iterations=5, radius=0.1)


OPTIONS = ImproverOptions()


class Improver:
    """Suggests points to a search: at the ends of its front, in the widest gaps, and in every branch.

    ``branches`` names the branch of each of some points. At the ends an objective is minimised; in gaps, and at the
    best point of every branch, one with the others below the middle of the gap, or where they are. ``spent``
    counts iterations, each as one evaluation.
    """

    def __init__(self, program: Program, branches: Callable[[Points], list[str]], *, solver: Solver = "auto") -> None:
        self.spent = 0
        self._program, self._branches, self._solver = program, branches, solver

    def is_due(self, generation: int, evaluations: int) -> bool:
        """Return whether it is time for points again, and iterations are left."""
        return generation % OPTIONS.every == 0 and self.spent <= OPTIONS.share * evaluations

    def suggest(self, x: Points, objectives: Float[np.ndarray, "front n_obj"]) -> Float[np.ndarray, suggested * point]:
        """Return points that a few iterations from those of a front (two at least) lead to."""
        rows, mains, upper = self._aims(objectives, x)
        upper[np.arange(len(rows)), mains] = np.inf
        weights = main_weights(objectives.shape[1], mains, OPTIONS.weight) / ranges_of(objectives)
        solutions = minimise_weighted(self._program, x[rows], weights, upper, OPTIONS.brief, solver=self._solver)
        self.spent += int(solutions.iterations.sum())
        return solutions.x[np.isfinite(solutions.objectives).all(axis=1)]

    def _aims(self, F: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows of the front to start from, the objective to minimise from each, and ε (rows, n_obj)."""
        count, shares = F.shape[1], F / ranges_of(F)
        aims = [(int(np.argmin(F[:, k])), k, np.full(count, np.inf)) for k in range(count)]
        distances = np.linalg.norm(shares[:, None] - shares[None], axis=2)
        np.fill_diagonal(distances, np.inf)
        nearest = distances.argmin(axis=1)
        for turn, i in enumerate(np.argsort(-distances.min(axis=1))[: OPTIONS.gaps] if count > 1 else ()):
            aims.append((int(i), turn % count, (F[i] + F[nearest[i]]) / 2))
        labels = np.array(self._branches(x))
        for label in np.unique(labels):
            members = np.flatnonzero(labels == label)
            best = int(members[np.argmin(shares[members].sum(axis=1))])
            aims.append((best, (len(aims) + 1) % count, F[best]))
        rows, mains, upper = (np.array(column) for column in zip(*aims, strict=True))
        return rows, mains, upper
