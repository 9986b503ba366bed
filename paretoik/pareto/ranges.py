"""What objectives are divided by, so that nothing depends on their units: their ranges, or their sizes without any."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.nlp.program import Program

RELATIVE_ROUNDING = 1e-9  # of an objective's size: a range below it is rounding


def objective_sizes(program: Program, x: Points, n_obj: int) -> Float[np.ndarray, " n_obj"]:
    """Return the size of every objective at points: the largest of |F|, and of what F changes by in a step of length 1.

    The second is to first order, along the gradient (rad or m, RMS): optima may have values of nothing but rounding.
    """
    at = [program.linearise(one) for one in x]
    values = np.array([each.objectives[:n_obj] for each in at])
    changes = np.array([np.linalg.norm(each.gradients[:n_obj], axis=1) * each.unit for each in at])
    return np.asarray(np.maximum(np.abs(values), changes).max(axis=0))


def ranges_of(
    values: Float[np.ndarray, "points n_obj"], sizes: Float[np.ndarray, " n_obj"] | None = None
) -> Float[np.ndarray, " n_obj"]:
    """Return nadir less ideal of points; where that is rounding the objective's size, or 1 where it is always 0.

    ``sizes`` are those of the values themselves by default.
    """
    width = np.ptp(values, axis=0)
    sizes = np.abs(values).max(axis=0) if sizes is None else sizes
    return np.where(width > RELATIVE_ROUNDING * sizes, width, np.where(sizes > 0, sizes, 1.0))
