"""Orientation errors of a frame against a desired rotation, in components: expressions or numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.autodiff.tape import where
from paretoik.robot.components import Component, Matrix, Vector, dot, minus, multiply, plus, scale, times, transpose

SINE_TOLERANCE = 1e-12  # the axis of a rotation with a smaller sine is rounding


def axis_times_sine(axes: str, between: Matrix) -> Vector:
    """Return axis · sin(angle) of a rotation, or with "xyz+z-axis" of the smallest one that moves z as it does.

    It is in the axes that are rotated; the free turn about z would tell these apart from those before.
    """
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = between
    if axes == "xyz+z-axis":
        return zy, times(-1.0, zx), 0.0
    return scale((minus(zy, yz), minus(xz, zx), minus(yx, xy)), 0.5)


def orientation_error(axes: str, rotation: Matrix, desired: Matrix) -> Vector:
    """Return the rotation vector of RᵀR_d, or with "xyz+z-axis" of the smallest rotation that takes z to z_d."""
    between = multiply(transpose(rotation), desired)
    if axes == "xyz+z-axis":
        x, y, z = transpose(between)[2]
        sine = np.sqrt(plus(times(x, x), times(y, y)))
        factor = _angle_over_sine(sine, z)
        return where(_is_half_turn(sine, z), np.pi, times(-1.0, times(y, factor))), times(x, factor), 0.0
    vector = axis_times_sine(axes, between)
    trace = plus(plus(between[0][0], between[1][1]), between[2][2])
    sine, cosine = np.sqrt(dot(vector, vector)), times(0.5, minus(trace, 1.0))
    opposite, error = _is_half_turn(sine, cosine), scale(vector, _angle_over_sine(sine, cosine))
    x, y, z = (where(opposite, half, part) for half, part in zip(_half_turn(between), error, strict=True))
    return x, y, z


def _angle_over_sine(sine: Component, cosine: Component) -> Component:
    small = np.less(sine, SINE_TOLERANCE)
    ratio: Component = where(small, 1.0, np.arctan2(sine, cosine) / where(small, 1.0, sine))
    return ratio


def _is_half_turn(sine: Component, cosine: Component) -> Component:
    condition: Component = np.multiply(np.less(sine, SINE_TOLERANCE), np.less(cosine, 0.0))
    return condition


def _half_turn(between: Matrix) -> Vector:
    """Return the rotation vector of a half turn: R + 1 = 2 a aᵀ, so that any of its columns gives the axis a."""
    x, y, z = (tuple(plus(between[i][j], float(i == j)) for i in range(3)) for j in range(3))
    # The longest column, which has the largest entry on the diagonal; the others may vanish.
    axis = _where(np.less_equal(z[2], y[1]), y, z)
    axis = _where(np.less_equal(z[2], x[0]) * np.less_equal(y[1], x[0]), x, axis)
    return scale(axis, np.pi / np.sqrt(dot(axis, axis)))


def _where(condition: Component, first: Sequence[Component], second: Sequence[Component]) -> Vector:
    x, y, z = (where(condition, one, other) for one, other in zip(first, second, strict=True))
    return x, y, z
