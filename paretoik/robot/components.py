"""Vector algebra on components: the form in which the robot kernels compute.

A component is an array over samples, a plain number where it is the same for all of them, or an expression where
derivatives are wanted. Numbers that are zero or
one cost nothing: products and sums with them are folded away. That is how one set of three-dimensional kernels runs a
planar arm at planar cost, and a Panda, whose frames are turned by right angles, without multiplying by its zeros.
Nothing here takes an absolute value, a maximum or a branch on an array, so everything runs on complex input too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from paretoik.autodiff.tape import Expression

if TYPE_CHECKING:
    Component: TypeAlias = "float | np.ndarray"  # as far as types go, an expression passes for an array
else:
    Component = float | np.ndarray | Expression
Triple: TypeAlias = tuple[Component, Component, Component]
Rows: TypeAlias = tuple[Triple, Triple, Triple]

ZERO: Triple = (0.0, 0.0, 0.0)


def times(a: Component, b: Component) -> Component:
    """Return a·b, folded where one of them is the number 0, 1 or −1."""
    if isinstance(a, float):
        a, b = b, a
    if isinstance(b, float):
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
        if b == -1.0:
            return -a
    return a * b


def plus(a: Component, b: Component) -> Component:
    """Return a + b, folded where one of them is the number 0."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Component, b: Component) -> Component:
    """Return a − b, folded where one of them is the number 0."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def add(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Triple, b: Triple) -> Triple:
    """Return a − b."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scale(a: Triple, factor: Component) -> Triple:
    """Return a · factor."""
    return times(a[0], factor), times(a[1], factor), times(a[2], factor)


def dot(a: Triple, b: Triple) -> Component:
    """Return the inner product (without conjugation)."""
    return plus(plus(times(a[0], b[0]), times(a[1], b[1])), times(a[2], b[2]))


def cross(a: Triple, b: Triple) -> Triple:
    """Return a × b."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


def apply(rows: Rows, a: Triple) -> Triple:
    """Return the matrix, given by its rows, times a."""
    return dot(rows[0], a), dot(rows[1], a), dot(rows[2], a)


def apply_transposed(rows: Rows, a: Triple) -> Triple:
    """Return the transposed matrix times a."""
    return apply(transpose(rows), a)


def transpose(rows: Rows) -> Rows:
    """Return the columns of a matrix given by its rows."""
    return tuple(zip(*rows, strict=True))  # type: ignore[return-value]


def multiply(a: Rows, b: Rows) -> Rows:
    """Return the matrix product."""
    columns = transpose(b)
    return tuple(tuple(dot(row, column) for column in columns) for row in a)  # type: ignore[return-value]


def turn(a: Triple, cosine: Component, sine: Component) -> Triple:
    """Return a turned about z by the angle whose cosine and sine are given."""
    return (
        minus(times(cosine, a[0]), times(sine, a[1])),
        plus(times(sine, a[0]), times(cosine, a[1])),
        a[2],
    )


def turn_back(a: Triple, cosine: Component, sine: Component) -> Triple:
    """Return a turned about z by the opposite angle."""
    return (
        plus(times(cosine, a[0]), times(sine, a[1])),
        minus(times(cosine, a[1]), times(sine, a[0])),
        a[2],
    )


def triple(vector: np.ndarray) -> Triple:
    """Return a constant vector (3,) as components."""
    return tuple(float(value) for value in vector)  # type: ignore[return-value]


def rows(matrix: np.ndarray) -> Rows:
    """Return a constant matrix (3, 3) as rows of components."""
    return tuple(triple(row) for row in matrix)  # type: ignore[return-value]
