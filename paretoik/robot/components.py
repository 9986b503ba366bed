"""Vector algebra on the components of robot kernels, and evaluation on batches.

A component is an array over samples, a plain number if it is the same for all samples, or an expression if derivatives
are taken. Vectors are triples of components, matrices are three rows. Products and sums with the numbers 0 and 1 are
left out. So the three-dimensional kernels cost no more than planar ones for a planar arm, and do not multiply by zeros
for a Panda, whose frames are rotated by right angles. No function uses absolute values, maxima or branches on arrays,
so all functions also accept complex input.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from paretoik.autodiff.tape import Expression
from paretoik.robot.chain import SerialChain

if TYPE_CHECKING:
    Component: TypeAlias = "float | np.ndarray"  # an expression has the type of an array here
else:
    Component = float | np.ndarray | Expression
Vector: TypeAlias = tuple[Component, Component, Component]
Matrix: TypeAlias = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)


def times(a: Component, b: Component) -> Component:
    """Return a·b, simplified if one of them is the number 0, 1 or −1."""
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
    """Return a + b, simplified if one of them is the number 0."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def minus(a: Component, b: Component) -> Component:
    """Return a − b, simplified if one of them is the number 0."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return -b
    return a - b


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a − b."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scale(a: Vector, factor: Component) -> Vector:
    """Return a · factor."""
    return times(a[0], factor), times(a[1], factor), times(a[2], factor)


def dot(a: Vector, b: Vector) -> Component:
    """Return the inner product (without conjugation)."""
    return plus(plus(times(a[0], b[0]), times(a[1], b[1])), times(a[2], b[2]))


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


def apply(matrix: Matrix, a: Vector) -> Vector:
    """Return matrix · a."""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


def apply_transposed(matrix: Matrix, a: Vector) -> Vector:
    """Return matrixᵀ · a."""
    return apply(transpose(matrix), a)


def transpose(matrix: Matrix) -> Matrix:
    """Return matrixᵀ, whose rows are the columns of the matrix."""
    return tuple(zip(*matrix, strict=True))  # type: ignore[return-value]


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Return the matrix product."""
    columns = transpose(b)
    return tuple(tuple(dot(row, column) for column in columns) for row in a)  # type: ignore[return-value]


def rotate_about_z(a: Vector, cosine: Component, sine: Component) -> Vector:
    """Return a rotated about z by an angle, given by cosine and sine."""
    return (minus(times(cosine, a[0]), times(sine, a[1])), plus(times(sine, a[0]), times(cosine, a[1])), a[2])


def rotate_back_about_z(a: Vector, cosine: Component, sine: Component) -> Vector:
    """Return a rotated about z by the opposite angle."""
    return (plus(times(cosine, a[0]), times(sine, a[1])), minus(times(cosine, a[1]), times(sine, a[0])), a[2])


def to_vector(vector: np.ndarray) -> Vector:
    """Return a constant vector (3,) as components."""
    return tuple(float(value) for value in vector)  # type: ignore[return-value]


def to_matrix(matrix: np.ndarray) -> Matrix:
    """Return a constant matrix (3, 3) as rows of components."""
    return tuple(to_vector(row) for row in matrix)  # type: ignore[return-value]


def evaluate_in_blocks(
    kernel: Callable[..., Sequence[Component]], arm: SerialChain, shape: tuple[int, ...], *arrays: np.ndarray
) -> np.ndarray:
    """Run ``kernel(*columns)`` over samples in blocks; return (*batch, *shape).

    The arrays are (*batch, dof). The kernel gets each argument as a list of dof contiguous columns and returns the
    entries of ``shape`` in order.
    """
    arrays = tuple(np.asarray(array) for array in arrays)
    batch = arrays[0].shape[:-1]
    count = int(np.prod(batch))
    flat = [array.reshape(count, arm.dof) for array in arrays]
    entries = int(np.prod(shape))
    out = np.empty((count, entries), dtype=np.result_type(float, *arrays))
    size = 6144  # samples: enough that the cost of a call is negligible; memory of 48 KB columns is reused
    for start in range(0, count, size):
        stop = min(start + size, count)
        block = [[np.ascontiguousarray(part[start:stop, joint]) for joint in range(arm.dof)] for part in flat]
        for entry, value in enumerate(kernel(*block)):
            out[start:stop, entry] = value
    return out.reshape(*batch, *shape)
