"""Which points of a front weights can reach: those on its convex hull."""

from __future__ import annotations

import numpy as np

from paretoik.arrays import Mask
from paretoik.front.front import Front
from paretoik.front.preference_options import OPTIONS


def reached_by_weights(front: Front) -> Mask:
    """Mark the points that have the least weighted sum of shares for some weights, a millionth of the ranges aside.

    The others lie above the convex hull: a mixture of points is better in every objective, so that for any weights one
    of these has a smaller sum. Solved a point, as a non-negative least-squares problem: find λ, s >= 0 with Σλ = 1 and
    Σ λ_q Z_q + s = Z_p − δ. The residual of a point on the hull is at least δ/√n_obj.
    """
    from scipy.optimize import nnls  # here: it takes its time

    shares, (points, size) = front.shares, front.shares.shape
    matrix = np.zeros((size + 1, points + size))
    matrix[:size, :points], matrix[:size, points:], matrix[size, :points] = shares.T, np.eye(size), 1.0
    residuals = [nnls(matrix, np.append(point - OPTIONS.hull, 1.0))[1] for point in shares]
    return np.array(residuals) > 0.1 * OPTIONS.hull
