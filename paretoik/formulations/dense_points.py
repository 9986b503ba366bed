"""Points of small dense programs as individuals of their formulation, which has genes for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.arrays import Genes, Points
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Individuals, decode
from paretoik.front.front import Front
from paretoik.nlp.program import Solver
from paretoik.pareto.cold_search import StartSearch

OBJECTIVE_TOLERANCE = 1e-6  # of an objective's size over all points: what genes may miss it by


def dense_cold_search(
    problem: Any, *, starts: int, seed: int, solver: Solver, observe: Callable[[int, int], object] | None
) -> StartSearch:
    """Return how optima are found from nothing: from so many starts that motors can hold, each by itself.

    Starts are drawn up to ten times, since in some postures no motor can hold the arm.
    """
    rng = np.random.default_rng(seed)
    x = problem.points(problem.sample_starts(starts, rng))
    for _ in range(10):
        if np.isfinite(x).all(axis=1).sum() >= starts:
            break
        x = np.concatenate([x, problem.points(problem.sample_starts(starts, rng))])
    x = x[np.isfinite(x).all(axis=1)][:starts]
    return StartSearch(program_of=problem.program, starts=x, n_obj=problem.n_obj, solver=solver, observe=observe)


def dense_individuals(problem: Any, x: Points, genes: Genes | None) -> Individuals:
    """Return points of a dense program as individuals.

    What is certified is what is reported: a point whose genes miss its objectives becomes the point of its genes.
    """
    rows = problem.genes(x) if genes is None else genes
    F, G = problem.evaluate(rows, return_values_of=["F", "G"])
    objectives = np.array([problem.program().evaluate(one)[0] for one in x])
    missed = (np.abs(F - objectives) > OBJECTIVE_TOLERANCE * np.abs(objectives).max(axis=0, initial=0.0)).any(axis=1)
    x = np.where(missed[:, None], problem.points(rows), x)
    return Individuals(
        x=x,
        objectives=F,
        genes=rows,
        motions=decode(problem, rows),
        violation_between=np.maximum(problem.violation_between(rows), G.max(axis=1)),
    )


def dense_front_points(problem: Any, front: Front) -> Points:
    """Return the points of a front's genes; raises InvalidInput where it has none."""
    if front.genes is None:
        raise InvalidInput(f"refine: a front of {', '.join(problem.names)} with its genes wanted, got one without")
    return np.asarray(problem.points(np.array(front.genes)))
