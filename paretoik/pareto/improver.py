"""Gradients that help a search on its way: a few iterations from points of its front, every few generations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.ranges import ranges_of


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
    best point of every branch, one with the others kept below the middle of the gap, or where they are. ``spent``
    counts iterations, each as one evaluation.
    """

    def __init__(
        self,
        program: Program,
        branches: Callable[[Points], list[str]],
        *,
        solver: Solver = "auto",
        options: ImproverOptions = OPTIONS,
    ) -> None:
        self.spent = 0
        self._program, self._branches, self._solver, self._options = program, branches, solver, options

    def is_due(self, generation: int, evaluations: int) -> bool:
        """Return whether it is time for points again, and iterations are left."""
        return generation % self._options.every == 0 and self.spent <= self._options.share * evaluations

    def suggest(self, x: Points, objectives: Float[np.ndarray, "front n_obj"]) -> Float[np.ndarray, suggested * point]:
        """Return points that a few iterations from those of a front (two at least) lead to."""
        rows, factors, upper = self._aims(objectives, x)
        solutions = minimise(self._program, x[rows], factors, upper, self._options.brief, solver=self._solver)
        self.spent += int(solutions.iterations.sum())
        return solutions.x[np.isfinite(solutions.objectives).all(axis=1)]

    def _aims(self, F: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows of the front to start from, and what is minimised and kept below what from each."""
        count, ranges = F.shape[1], ranges_of(F)
        shares = F / ranges
        rows, mains, levels = list[int](), list[int](), list[np.ndarray]()
        for k in range(count):
            rows.append(int(np.argmin(F[:, k])))
            mains.append(k)
            levels.append(np.full(count, np.inf))
        distances = np.linalg.norm(shares[:, None] - shares[None], axis=2)
        np.fill_diagonal(distances, np.inf)
        nearest = distances.argmin(axis=1)
        for turn, i in enumerate(np.argsort(-distances.min(axis=1))[: self._options.gaps] if count > 1 else ()):
            rows.append(int(i))
            mains.append(turn % count)
            levels.append((F[i] + F[nearest[i]]) / 2)
        names = np.array(self._branches(x))
        for name in np.unique(names):
            members = np.flatnonzero(names == name)
            rows.append(int(members[np.argmin(shares[members].sum(axis=1))]))
            mains.append(len(rows) % count)
            levels.append(F[rows[-1]])
        upper = np.full((len(rows), len(self._program.upper)), np.inf)
        factors = np.zeros_like(upper)
        factors[:, :count] = self._options.weight / ranges
        factors[np.arange(len(rows)), mains] = 1.0 / ranges[mains]
        upper[:, :count] = np.array(levels)
        upper[np.arange(len(rows)), mains] = np.inf
        return np.array(rows), factors, upper
