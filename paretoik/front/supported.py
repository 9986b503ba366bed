"""Which points of a front weights can reach: those on its convex hull."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paretoik.arrays import Mask, Objectives
from paretoik.front.preference_options import OPTIONS

if TYPE_CHECKING:  # a front asks this file for its supported points
    from paretoik.front.front import Front


def supported(front: Front) -> Mask:
    """Mark the points that have the least weighted sum of shares for some weights, a millionth of the ranges aside.

    The others lie above the convex hull: a mixture of points is better in every objective, so that for any weights one
    of these has a smaller sum.
    """
    return _on_lower_hull(front.shares) if len(front.names) == 2 else _unmatched_by_mixtures(front.shares)


def _on_lower_hull(shares: Objectives) -> Mask:
    """Mark points (points, 2) by the lower convex hull; Andrew 1979, Information Processing Letters 9(5)."""
    hull = list[tuple[float, float]]()
    for x, y in sorted(map(tuple, shares.tolist())):
        if hull and x == hull[-1][0]:  # no better than the one before
            continue
        while len(hull) > 1 and _turns_right(hull[-2], hull[-1], (x, y)):
            hull.pop()
        hull.append((x, y))
    corners_x, corners_y = np.array(hull).T
    heights = np.interp(shares[:, 0] - OPTIONS.hull, corners_x, corners_y, left=np.inf)
    return np.asarray(shares[:, 1] - OPTIONS.hull < heights)


def _turns_right(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])


def _unmatched_by_mixtures(shares: Objectives) -> Mask:
    """Mark points (points, n_obj) that no mixture of points beats, by least-squares problems.

    A mixture beats p if λ, s >= 0 exist with Σλ = 1 and Σ λ_q Z_q + s = Z_p − δ. The least residual of a point on the
    hull is at least δ/√n_obj. Mixtures begin with the points near p and the best of every objective. While the
    residual r separates p from these but not from all points, the point farthest along r joins (column generation).
    """
    from scipy.optimize import nnls  # here: it takes its time
    from scipy.spatial import KDTree

    points, size = shares.shape
    _, near = KDTree(shares).query(shares, k=np.arange(1, min(OPTIONS.neighbours, points) + 1))
    ends = shares.argmin(axis=0)
    unmatched = np.ones(points, dtype=bool)
    for row, point in enumerate(shares):
        columns = np.unique(np.concatenate([near[row], ends]))
        target = np.append(point - OPTIONS.hull, 1.0)
        while True:
            slack = np.vstack([np.eye(size), np.zeros(size)])
            matrix = np.hstack([np.vstack([shares[columns].T, np.ones(len(columns))]), slack])
            mixture, residual = nnls(matrix, target)
            if residual <= 0.1 * OPTIONS.hull:
                unmatched[row] = False
                break
            direction = target - matrix @ mixture
            farthest = int(np.argmax(shares @ direction[:-1]))
            if farthest in columns:  # the optimum over all points, rounding aside
                break
            columns = np.append(columns, farthest)
    return unmatched
