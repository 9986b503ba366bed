"""Objectives made one: divided by their ranges, weighted, and bounded from above by ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Points
from paretoik.distribution import workers
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions, concatenate

Observe: TypeAlias = Callable[..., object]
"""Called with what is done and with all there is to do; by a cold search of motions also with what they violate."""


def objective_sizes(program: Program, x: Points, n_obj: int) -> Float[np.ndarray, " n_obj"]:
    """Return the size of every objective at points: the largest of |F|, and of what F changes by in a step of length 1.

    The second is to first order, along the gradient (rad, RMS): optima may have values of nothing but rounding. What an
    objective owes to auxiliary variables has no such length and does not count.
    """
    at = [program.linearise(one) for one in x]
    values = np.array([each.objectives[:n_obj] for each in at])
    slopes = [np.linalg.norm(each.gradients[:n_obj, : each.unknowns], axis=1) for each in at]
    changes = np.array([slope * each.unit for slope, each in zip(slopes, at, strict=True)])
    return np.asarray(np.maximum(np.abs(values), changes).max(axis=0))


def main_weights(n_obj: int, mains: Int[np.ndarray, " rows"], weight: float | np.ndarray) -> np.ndarray:
    """Return weights (rows, n_obj): 1 for each row's main objective, ``weight``, one or (rows,), for the others."""
    weights = np.repeat(np.broadcast_to(weight, len(mains))[:, None], n_obj, axis=1)
    weights[np.arange(len(mains)), mains] = 1.0
    return weights


def minimise_weighted(
    program: Program,
    x: Points,
    weights: Float[np.ndarray, "#points n_obj"],
    upper: Float[np.ndarray, "#points n_obj"] | None,
    barrier: InteriorPointOptions | Sequence[InteriorPointOptions],
    *,
    solver: Solver,
    batch: int | None = None,
    observe: Observe | None = None,
) -> Solutions:
    """Return where points lead when weights · F is minimised with F below ``upper``; ``observe`` looks on batchwise.

    Only the first n_obj of the program's F are weighted and bounded. ``barrier`` is for all, or one a point. Workers
    are given all points at once, and looked on as they return them.
    """
    count, n_obj = len(x), weights.shape[1]
    upper = np.full((1, n_obj), np.inf) if upper is None else upper
    others = ((0, 0), (0, len(program.upper) - n_obj))
    weights = np.pad(np.broadcast_to(weights, (count, n_obj)), others)
    upper = np.pad(np.broadcast_to(upper, (count, n_obj)), others, constant_values=np.inf)
    if count > 1 and workers() > 1:
        shown = None if observe is None else lambda done: observe(done, count)
        return minimise(program, x, weights, upper, barrier, solver=solver, observe=shown)
    batch, parts = batch or max(count, 1), list[Solutions]()
    for first in range(0, max(count, 1), batch):
        rows = slice(first, first + batch)
        options = barrier if isinstance(barrier, InteriorPointOptions) else barrier[rows]
        parts.append(minimise(program, x[rows], weights[rows], upper[rows], options, solver=solver))
        if observe is not None:
            observe(min(first + batch, count), count)
    return concatenate(parts)
