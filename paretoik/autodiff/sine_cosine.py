"""Sine and cosine of many numbers at once: without branches, so that a processor works on several together.

Reduction by multiples of π/2 in two parts, then the polynomials of fdlibm's kernels (Sun Microsystems 1993): right
within one unit in the last place, or 1e-20 where that is more.
"""

from __future__ import annotations

import math

import numpy as np

from paretoik.compilation import compiled

MAX_REDUCED = 1e5  # rad: up to here the reduction keeps all digits; beyond, math.sin and math.cos
ROUNDING = 6755399441055744.0  # 1.5 · 2⁵²: adding and subtracting it rounds to an integer
QUARTERS = 6.36619772367581382433e-01  # 2 / π
QUARTER, QUARTER_REST = 1.57079632673412561417e00, 6.07710050650619224932e-11  # π / 2 in two parts
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@compiled
def sines_and_cosines(sine, cosine, x, n):
    """Write the sines and the cosines [rad] of the first ``n`` angles."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            sine[k], cosine[k] = math.sin(x[k]), math.cos(x[k])
        return
    for k in range(n):
        sine[k], cosine[k] = _sine_cosine(x[k])


@compiled
def sines(to, x, n):
    """Write the sines [rad] of the first ``n`` angles."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            to[k] = math.sin(x[k])
        return
    for k in range(n):
        to[k] = _sine_cosine(x[k])[0]


@compiled
def cosines(to, x, n):
    """Write the cosines [rad] of the first ``n`` angles."""
    if _exceeds_reduction(x, n):
        for k in range(n):
            to[k] = math.cos(x[k])
        return
    for k in range(n):
        to[k] = _sine_cosine(x[k])[1]


@compiled
def _exceeds_reduction(x, n):
    largest = 0.0
    for k in range(n):
        largest = max(largest, abs(x[k]))
    return largest > MAX_REDUCED


@compiled
def _sine_cosine(x):
    k = (x * QUARTERS + ROUNDING) - ROUNDING
    near = x - k * QUARTER
    a = near - k * QUARTER_REST
    tail = (near - a) - k * QUARTER_REST  # a + tail is the reduced angle to twice the digits
    z = a * a
    v = z * a
    sine = a - ((z * (0.5 * tail - v * (S2 + z * (S3 + z * (S4 + z * (S5 + z * S6))))) - tail) - v * S1)
    half = 0.5 * z
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * (z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))) - a * tail))
    quarter = k - 4.0 * np.floor(0.25 * k)
    odd = (quarter == 1.0) | (quarter == 3.0)
    first, second = (cosine, sine) if odd else (sine, cosine)
    return -first if quarter >= 2.0 else first, -second if (quarter == 1.0) | (quarter == 2.0) else second
