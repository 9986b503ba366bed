"""Geometry of fronts: tangents, points that weights can reach, jumps and missing hypervolume."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Mask, Objectives


def tangents_meet(
    left: Float[np.ndarray, " 2"],
    right: Float[np.ndarray, " 2"],
    left_weights: Float[np.ndarray, " 2"],
    right_weights: Float[np.ndarray, " 2"],
) -> Float[np.ndarray, " 2"] | None:
    """Return the point at which the tangents of two neighbours meet, or None.

    A tangent is perpendicular to the weights, NaN if unknown. Returns None if weights are unknown, or if the tangents
    do not meet between the two points in both objectives. On a smooth piece of a front, convex or not, they do if
    neighbours are close enough; across a jump the tangents contradict each other. If they meet outside by at most a
    millionth of the distance, the point is moved inside.
    """
    margin = 1e-6
    width = right - left
    determinant = left_weights[0] * right_weights[1] - left_weights[1] * right_weights[0]
    if not np.isfinite(determinant) or determinant == 0.0:
        return None
    place = np.array([-left_weights[1], left_weights[0]]) * (right_weights @ width) / determinant
    share = place / width
    if np.any(share < -margin) or np.any(share > 1.0 + margin):
        return None
    return left + np.clip(share, 0.0, 1.0) * width


def curve_area(values: Float[np.ndarray, "2 2"], meeting: Float[np.ndarray, " 2"] | None) -> float:
    """Return the hypervolume that the front between two neighbours adds to them.

    The front is approximated by the parabola that touches both tangents, which meet at ``meeting``; if that is unknown
    (None), by the chord.
    """
    left, right = values
    width = right - left
    offset = 0.5 * width if meeting is None else meeting - left
    bulge = (offset[0] * width[1] - offset[1] * width[0]) / 3  # two thirds of the triangle, positive below the chord
    return float(bulge - 0.5 * width[0] * width[1])


@dataclass(frozen=True, kw_only=True)
class PreferenceOptions:
    """Settings of preferences; scores and distances are in shares of the ranges.

    rounding: largest difference of scores that count as equal; other units and offsets change scores by less
    augmentation: weight of the sum of all shares relative to the worst one (Miettinen 1999, section 3.4.5)
    hull: largest distance above the convex hull at which a point counts as on it
    prediction: largest relative error of a prediction for which exchange rates hold
    described: largest number of objectives for which every comparison has a sentence
    neighbours: number of nearest points in the first convex combinations that are compared with a point
    """

    rounding: float = 1e-9
    augmentation: float = 1e-4
    hull: float = 1e-6
    prediction: float = 0.1
    described: int = 3
    neighbours: int = 30


PREFERENCE_OPTIONS = PreferenceOptions()


# Points that weights can reach: those on the convex hull.


def lower_hull(values: Float[np.ndarray, "points 2"]) -> list[int]:
    """Return the rows of points on the lower convex hull.

    ``values`` are sorted by the first objective, then by the second. Source: Andrew 1979, Information Processing
    Letters 9(5).
    """
    hull, points = list[int](), values.tolist()
    for row, (x, y) in enumerate(points):
        if hull and x == points[hull[-1]][0]:  # no better than the last point of the hull
            continue
        while len(hull) > 1:
            (ax, ay), (bx, by) = points[hull[-2]], points[hull[-1]]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):  # the hull turns left
                break
            hull.pop()
        hull.append(row)
    return hull


def supported(shares: Objectives) -> Mask:
    """Mark the points with the least weighted sum of ``shares`` for some weights.

    With two objectives these are on the lower convex hull.
    """
    if shares.shape[1] != 2:
        return unmatched_by_mixtures(shares)
    ordered = shares[np.lexsort((shares[:, 1], shares[:, 0]))]
    corners_x, corners_y = ordered[lower_hull(ordered)].T
    heights = np.interp(shares[:, 0] - PREFERENCE_OPTIONS.hull, corners_x, corners_y, left=np.inf)
    return np.asarray(shares[:, 1] - PREFERENCE_OPTIONS.hull < heights)


def unmatched_by_mixtures(shares: Objectives) -> Mask:
    """Mark the points that no convex combination of points beats by δ, by nonnegative least squares.

    A combination beats p if λ, s >= 0 exist with Σλ = 1 and Σ λ_q Z_q + s = Z_p − δ. For p on the hull the residual is
    at least δ/√n_obj. The first combinations are of the points near p and each objective's best. While the residual r
    separates p from these but not from all points, the point farthest along r is added (column generation).
    """
    from scipy.optimize import nnls  # imported here, because it is slow
    from scipy.spatial import KDTree

    points, size = shares.shape
    _, near = KDTree(shares).query(shares, k=np.arange(1, min(PREFERENCE_OPTIONS.neighbours, points) + 1))
    ends = shares.argmin(axis=0)
    unmatched = np.ones(points, dtype=bool)
    for row, point in enumerate(shares):
        columns = np.unique(np.concatenate([near[row], ends]))
        target = np.append(point - PREFERENCE_OPTIONS.hull, 1.0)
        while True:
            slack = np.vstack([np.eye(size), np.zeros(size)])
            matrix = np.hstack([np.vstack([shares[columns].T, np.ones(len(columns))]), slack])
            mixture, residual = nnls(matrix, target)
            if residual <= 0.1 * PREFERENCE_OPTIONS.hull:
                unmatched[row] = False
                break
            direction = target - matrix @ mixture
            farthest = int(np.argmax(shares @ direction[:-1]))
            if farthest in columns:  # the optimum over all points, within rounding
                break
            columns = np.append(columns, farthest)
    return unmatched


# Jumps of a front, and its missing hypervolume.


@dataclass(frozen=True, kw_only=True)
class JumpOptions:
    """Options for finding jumps.

    places: number of evenly spaced places that are checked between two neighbours
    height: least height of a barrier, as a share of the front's ranges; solvers are not more exact
    """

    places: int = 7
    height: float = 1e-6


JUMPS = JumpOptions()


def barriers(values: Objectives, inner: Float[np.ndarray, "pairs places 2"]) -> Int[np.ndarray, " jumps"]:
    """Return the rows after which a front jumps.

    ``inner`` are objectives at places between neighbours. On one branch the optimum moves continuously from one
    neighbour to the other: to first order, no point in between is worse than both in an objective. Between two
    branches, in different valleys, some are. Tangents do not show a jump: if branches cross, they are like those of a
    concave front, and at an inflection of one branch they contradict each other.
    """
    corners = np.maximum(values[:-1], values[1:]) + JUMPS.height * np.ptp(values, axis=0)
    return np.flatnonzero((inner > corners[:, None]).any(axis=(1, 2)))


def missing_hypervolume(values: Objectives, normals: Float[np.ndarray, "points 2"]) -> float:
    """Return the estimated share of the hypervolume that the points miss.

    There must be at least two points; ``normals`` are perpendicular to their front, NaN if unknown.
    """
    order = np.argsort(values[:, 0], kind="stable")
    values, normals = values[order], normals[order]
    pairs = [[i, j] for i, j in pairwise(range(len(values))) if (values[i] != values[j]).all()]
    missing = sum(curve_area(values[pair], tangents_meet(*values[pair], *normals[pair])) for pair in pairs)
    steps = (values[-1, 0] - values[1:, 0]) * (values[:-1, 1] - values[1:, 1])
    whole = float(steps.sum()) + missing
    return missing / whole if whole > 0 else 0.0
