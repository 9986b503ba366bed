"""Weights of joints near their position limits, and of criteria, compiled.

Equation numbers are those of Wan et al. 2018.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled


@compiled
def buffer_depth(q, lower, upper, width):
    """Return the depth of a joint in a buffer: −1 at its lower limit or past it, 0 between, 1 at the upper.

    Source: Eqs. 16 and 20.
    """
    if not width < np.inf:
        return 0.0
    low, high = lower + width - q, q - (upper - width)
    if low >= 0 and low >= high:
        return -min(low / width, 1.0) if width > 0 else -1.0
    if high >= 0:
        return min(high / width, 1.0) if width > 0 else 1.0
    return 0.0


@compiled
def clamping_weight(depth):
    """Return the weight of a joint at a depth in its buffer: from 1 outside to 0 at its limit. Source: Eq. 17."""
    d = abs(depth)
    if d <= 0.0:
        return 1.0
    if d >= 1.0:
        return 0.0
    return 0.5 - 0.5 * np.tanh(1.0 / (1.0 - d) - 1.0 / d)


@compiled
def criterion_weight(exponent, sign, band):
    """Return the weight of a criterion: 1 where its normalised value is below ``band``, 0 above 1 − band.

    ``exponent`` is (reference − H) times the sign. Source: Eqs. 24 to 28, the cubic being 1 − 3s² + 2s³.
    """
    value = np.exp(min(exponent, 0.0)) if sign > 0 else 1.0 - np.exp(min(-exponent, 700.0))
    s = min(max((value - band) / (1.0 - 2.0 * band), 0.0), 1.0)
    return 1.0 - s * s * (3.0 - 2.0 * s)


@compiled
def least_norm_weight(q, lower, upper, span, previous_slope, j):
    """Return the inverse weight of joint j (Eq. 10), and write its slope for the next step.

    A joint with one limit is slowed in the half of its range that is next to it.
    """
    if not span < np.inf:
        return 1.0
    largest = 1e12  # slope at a limit, where the criterion grows without bounds
    above, below = upper - q, q - lower
    if above == np.inf:
        above = max(span - below, below)
    elif below == np.inf:
        below = max(span - above, above)
    if above <= 0.0 or below <= 0.0:
        slope = largest
    else:
        derivative = span**2 * (below - above) / (4.0 * above * above * below * below)  # Eq. 11
        slope = min(abs(derivative), largest)
    approaching = slope >= previous_slope[j]
    previous_slope[j] = slope
    return 1.0 / (1.0 + slope) if approaching else 1.0
