"""Searches along a line, compiled into their callers: the least of a function, and where it changes sign.

``function(x, arguments)`` is compiled, and ``arguments`` a tuple of what it reads and writes. A caller keeps the code
that it was compiled with: delete its cache after a change here.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import inlined

GOLDEN = 0.6180339887498949  # (√5 − 1) / 2


@inlined
def golden_section(function, arguments, low, high, iterations, tie=np.inf, target=-np.inf):
    """Return (value, x) of the least between two places, by golden sections; exact where there is one local minimum.

    Where two values are equal the search goes on towards ``tie``. It ends at the first value at or below ``target``.
    Source: Kiefer 1953, Sequential minimax search for a maximum.
    """
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = function(a, arguments), function(b, arguments)
    for _ in range(iterations):
        if at_a <= target or at_b <= target:
            break
        if at_a < at_b or (at_a == at_b and b > tie):
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = function(a, arguments)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = function(b, arguments)
    return (at_a, a) if at_a <= at_b else (at_b, b)


@inlined
def bisect(function, arguments, inside, outside, iterations):
    """Return the place nearest to ``outside`` where the function is not negative; it is not at ``inside``."""
    for _ in range(iterations):
        middle = 0.5 * (inside + outside)
        if function(middle, arguments) >= 0.0:
            inside = middle
        else:
            outside = middle
    return inside
