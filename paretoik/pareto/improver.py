"""Gradients that help a search on its way: a few iterations from points of its front, every few generations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.front.indicators import ranges_of
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.scalarisation import main_weights, minimise_weighted


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


def suggest_points(
    program: Program,
    x: Points,
    F: Float[np.ndarray, "points n_obj"],
    branches: Sequence[str],
    *,
    solver: Solver = "auto",
) -> tuple[Float[np.ndarray, " suggested *point"], int]:
    """Return points that a few iterations from those of a front (two at least) lead to, and how many iterations.

    At the ends of the front an objective is minimised; in its widest gaps, and at the best point of every branch, one
    with the others below the middle of the gap, or where they are.
    """
    count, ranges = F.shape[1], ranges_of(F)
    shares = F / ranges
    aims = [(int(np.argmin(F[:, k])), k, np.full(count, np.inf)) for k in range(count)]  # row, objective, ε
    distances = np.linalg.norm(shares[:, None] - shares[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = distances.argmin(axis=1)
    for turn, i in enumerate(np.argsort(-distances.min(axis=1))[: OPTIONS.gaps] if count > 1 else ()):
        aims.append((int(i), turn % count, (F[i] + F[nearest[i]]) / 2))
    labels = np.array(branches)
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        best = int(members[np.argmin(shares[members].sum(axis=1))])
        aims.append((best, (len(aims) + 1) % count, F[best]))
    rows, mains, upper = (np.array(column) for column in zip(*aims, strict=True))
    upper[np.arange(len(rows)), mains] = np.inf
    weights = main_weights(count, mains, OPTIONS.weight) / ranges
    solutions = minimise_weighted(program, x[rows], weights, upper, OPTIONS.brief, solver=solver)
    return solutions.x[np.isfinite(solutions.objectives).all(axis=1)], int(solutions.iterations.sum())
