"""Tangents of a front of two objectives, from the weights of the objectives at its points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def tangents_meet(
    left: Float[np.ndarray, " 2"],
    right: Float[np.ndarray, " 2"],
    left_weights: Float[np.ndarray, " 2"],
    right_weights: Float[np.ndarray, " 2"],
    *,
    margin: float = 1e-6,
) -> Float[np.ndarray, " 2"] | None:
    """Return where the tangents at two neighbours meet; None unless that is between the two in both objectives.

    A tangent lies across the weights. On a smooth piece of a front, whichever way it is bent, tangents meet between
    neighbours that are close enough; across a jump they contradict each other. Weights are NaN where unknown. Where
    tangents meet outside by a share of at most ``margin`` of the gap, they still meet inside.
    """
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

    It is taken for the parabola that touches the tangents at both, which meet there, or else for the chord.
    """
    left, right = values
    width = right - left
    offset = 0.5 * width if meeting is None else meeting - left
    bulge = (offset[0] * width[1] - offset[1] * width[0]) / 3  # two thirds of the triangle, below the chord positive
    return float(bulge - 0.5 * width[0] * width[1])
