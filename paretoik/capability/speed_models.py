"""Models of the tool's speed: an ellipsoid of velocities at every position.

Directional maxima form one polygon at each position, which is not convex (a union over postures). A model is an ellipse
or ellipsoid at every position, smooth in the position. Source: Kim, Choi & Jang 2021, Model-predictive-control-based
time-optimal trajectory planning of the distributed actuation mechanism, section 3.1 and Eq. 5. ``speed_fit`` fits them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement, product
from math import comb
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import InvalidInput
from paretoik.inputs import check_size, shown
from paretoik.tables import represented

# Polynomials of a position, several at once, with derivatives and bounds over a box.


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomials:
    """Polynomials of total ``degree`` in x = (p − center) / scale, one per column of ``coefficients``.

    Rows are the ``monomials``: 1, x₁, x₂, x₁², x₁x₂, x₂² for two coordinates and degree 2.
    """

    degree: int
    center: Float[np.ndarray, " task"]
    scale: float
    coefficients: Float[np.ndarray, "terms columns"]

    def __call__(
        self, positions: Float[np.ndarray, "*batch task"]
    ) -> tuple[Float[np.ndarray, "*batch columns"], Float[np.ndarray, "*batch columns task"]]:
        """Return values and their derivatives with respect to the position [1/m]."""
        design = self.design(positions)
        values = (design @ self._jet).reshape(*design.shape[:-1], -1, 1 + len(self.center))
        return values[..., 0], values[..., 1:]

    def design(self, positions: Float[np.ndarray, "*batch task"]) -> Float[np.ndarray, "*batch terms"]:
        """Return the monomials' values: the design matrix of a fit."""
        x = np.ones((*positions.shape[:-1], 1 + len(self.center)))
        x[..., 1:] = (positions - self.center) / self.scale
        values: np.ndarray = np.multiply.reduce(x[..., self._factors], axis=-1)
        return values

    def bernstein(
        self, lower: Float[np.ndarray, " task"], upper: Float[np.ndarray, " task"]
    ) -> Float[np.ndarray, "points terms"]:
        """Return the matrix from monomial to tensor Bernstein coefficients of a box.

        Over the box a polynomial is a convex combination of its Bernstein coefficients. Source: Farouki 2012, The
        Bernstein polynomial basis: a centennial retrospective, section 5.
        """
        nodes = np.linspace(0.0, 1.0, self.degree + 1)
        order = np.arange(self.degree + 1)
        chosen = np.array([comb(self.degree, i) for i in order])
        values = chosen * nodes[:, None] ** order * (1 - nodes[:, None]) ** (self.degree - order)
        interpolate = whole = np.linalg.inv(values)
        for _ in range(len(lower) - 1):
            whole = np.kron(whole, interpolate)
        shares = np.array(list(product(nodes, repeat=len(lower))))
        matrix: np.ndarray = whole @ self.design(lower + shares * (upper - lower))
        return matrix

    @cached_property
    def _factors(self) -> Int[np.ndarray, "terms degree"]:
        return monomials(len(self.center), self.degree)

    @cached_property
    def _jet(self) -> Float[np.ndarray, "terms numbers"]:
        """Coefficients of values and derivatives, so that one product gives both."""
        place = {tuple(row): index for index, row in enumerate(self._factors.tolist())}
        jet = np.zeros((*self.coefficients.shape, 1 + len(self.center)))
        jet[..., 0] = self.coefficients
        for row, index in place.items():
            for axis in set(row) - {0}:
                lowered = list(row)
                lowered[row.index(axis)] = 0  # a factor 1 in place of one x
                below = place[tuple(sorted(lowered))]
                jet[below, :, axis] += row.count(axis) / self.scale * self.coefficients[index]
        return jet.reshape(len(place), -1)


def monomials(task: int, degree: int) -> Int[np.ndarray, "terms degree"]:
    """Return the factors of each monomial as indices: 0 for 1, i for xᵢ. The lowest degree comes first."""
    rows = list(combinations_with_replacement(range(1 + task), degree))
    return np.array(rows, dtype=int).reshape(len(rows), degree)


def empty_polynomials(positions: Float[np.ndarray, "samples task"], degree: int) -> Polynomials:
    """Return polynomials without columns, to be fitted at positions; all coordinates have one scale.

    Raises InvalidInput unless the degree is a whole number of at least 0.
    """
    check_size("degree", degree, 0)
    center = positions.mean(axis=0)
    scale = float(np.linalg.norm(positions - center, axis=1).max()) or 1.0
    terms = len(monomials(positions.shape[1], degree))
    return Polynomials(degree=degree, center=center, scale=scale, coefficients=np.zeros((terms, 0)))


def orthogonal_design(
    polynomials: Polynomials, positions: Float[np.ndarray, "samples task"]
) -> tuple[Float[np.ndarray, "samples terms"], Float[np.ndarray, "terms terms"]]:
    """Return Q and R of the design matrix, QᵀQ / samples = I; raises InvalidInput if its rank is too low."""
    design, (size, task) = polynomials.design(positions), positions.shape
    terms = design.shape[1]
    wish = f"positions must be at least {terms} for polynomials of degree {polynomials.degree} in {task} coordinates"
    if size < terms:
        raise InvalidInput(f"{wish}, got {size}")
    rank = numerical_rank(design)
    if rank < terms:
        raise InvalidInput(f"{wish}, in general position, got {size} that determine only {rank} of {terms} terms")
    orthogonal, triangular = np.linalg.qr(design)
    return orthogonal * np.sqrt(size), triangular / np.sqrt(size)


def numerical_rank(matrix: np.ndarray) -> int:
    """Return a matrix's number of singular values above 1e-9 of the largest."""
    return int(np.linalg.matrix_rank(matrix, rtol=1e-9))


# Speed models: an ellipsoid of velocities at every position.


Roots: TypeAlias = tuple[Float[np.ndarray, "*batch task task"], Float[np.ndarray, "*batch task task variables"]]


@runtime_checkable
class SpeedModel(Protocol):
    """Ellipsoids of tool velocity, smooth in the position.

    At p the ellipsoid contains the velocities v with ‖R(p) v‖ ≤ 1, so that a path takes the time ∫ ‖R(p) dp‖. ``lower``
    and ``upper`` (task,) [m] are the corners of the box of valid positions.
    """

    @property
    def lower(self) -> Float[np.ndarray, " task"]: ...  # noqa: D102  read only: models are frozen

    @property
    def upper(self) -> Float[np.ndarray, " task"]: ...  # noqa: D102

    def roots(self, positions: Float[np.ndarray, "*batch task"]) -> Roots:
        """Return R(p) [s/m] and ∂R/∂p [s/m²], the coordinate of p last."""


def speeds_along(
    roots: Float[np.ndarray, "*batch task task"], directions: Float[np.ndarray, "directions task"]
) -> Float[np.ndarray, "*batch directions"]:
    """Return 1 / ‖R d‖ [m/s], the largest speeds along unit vectors d."""
    speeds: np.ndarray = 1.0 / np.linalg.norm(directions @ roots, axis=-1)
    return speeds


def model_speeds(
    model: SpeedModel, positions: Float[np.ndarray, "*batch task"], directions: Float[np.ndarray, "directions task"]
) -> Float[np.ndarray, "*batch directions"]:
    """Return the largest speeds [m/s] at positions along unit vectors; raises InvalidInput as ``roots`` does."""
    return speeds_along(model.roots(positions)[0], directions)


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class PolynomialEllipsoids:
    """Ellipsoids vᵀ P v ≤ 1 with P = Q(p) / s(p)²; log s and the entries of Q are polynomials.

    polynomials: polynomials of log s, s in m/s, and of the entries of the symmetric Q on and above its diagonal, row by
        row
    lower, upper: corners (task,) of the box of valid positions [m]

    A fit makes Q positive definite within the box; R is not finite if Q is not positive definite.
    """

    polynomials: Polynomials
    lower: Float[np.ndarray, " task"]
    upper: Float[np.ndarray, " task"]

    speeds = model_speeds

    def roots(self, positions: Float[np.ndarray, "*batch task"]) -> Roots:
        """Return R = Q^(1/2) / s [s/m] and ∂R/∂p [s/m²], the coordinate of p last."""
        values, gradients = self.polynomials(positions)
        return (planar_roots if len(self.lower) == 2 else spectral_roots)(values, gradients)

    def scaled(self, factor: float) -> PolynomialEllipsoids:
        """Return the model with all speeds times a factor."""
        coefficients = self.polynomials.coefficients.copy()
        coefficients[0, 0] += np.log(factor)
        return replace(self, polynomials=replace(self.polynomials, coefficients=coefficients))


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class AxesEllipses:
    """Ellipses by their radii a, b [m/s] and the angle c [rad] of the first, each a polynomial of the position.

    This is the paper's model, with its weaknesses: c and c + π are the same angle, so no polynomial fits c if ellipses
    turn around a position, and the polynomials a and b may fall below zero. Source: Kim, Choi & Jang 2021, Eq. 5.

    axes: polynomials of a, b and c
    lower, upper: corners (2,) of the box of valid positions [m]
    """

    axes: Polynomials
    lower: Float[np.ndarray, " task"]
    upper: Float[np.ndarray, " task"]

    speeds = model_speeds

    def roots(self, positions: Float[np.ndarray, "*batch 2"]) -> Roots:
        """Return R [s/m] and ∂R/∂p [s/m²], the coordinate of p last.

        Raises InvalidInput, naming the position, if a radius is not positive.
        """
        axes, gradients = self.axes(positions)
        if not np.all(axes[..., :2] > 0):
            index = tuple(np.argwhere(~np.all(axes[..., :2] > 0, axis=-1))[0])
            place = " ".join(f"{number:.6g}" for number in positions[index])
            raise InvalidInput(
                f"positions must have an ellipse with radii above zero, got a = {axes[index][0]:.4g} and "
                f"b = {axes[index][1]:.4g} m/s at [{place}] m"
            )
        inverse = 1.0 / axes[..., :2]
        change = -(inverse[..., None] ** 2) * gradients[..., :2, :]
        cosine, sine = np.cos(2 * axes[..., 2]), np.sin(2 * axes[..., 2])
        reflection = np.stack([cosine, sine, sine, -cosine], axis=-1).reshape(*cosine.shape, 2, 2)
        derivative = np.stack([-sine, cosine, cosine, sine], axis=-1).reshape(*cosine.shape, 2, 2)
        difference, mean = (inverse @ [0.5, -0.5])[..., None, None], (inverse @ [0.5, 0.5])[..., None, None]
        return mean * np.eye(2) + difference * reflection, (
            (change[..., 0, :] + change[..., 1, :])[..., None, None, :] / 2 * np.eye(2)[..., None]
            + (change[..., 0, :] - change[..., 1, :])[..., None, None, :] / 2 * reflection[..., None]
            + 2 * (difference * derivative)[..., None] * gradients[..., 2, :][..., None, None, :]
        )


def spectral_roots(
    values: Float[np.ndarray, "*batch columns"], gradients: Float[np.ndarray, "*batch columns variables"]
) -> Roots:
    """Return R = Q^(1/2) / s and its derivatives, from log s and the upper triangle of Q.

    They are not finite if Q is not positive definite. Source: Higham, Functions of Matrices, theorem 3.11.
    """
    place = upper_triangle(values.shape[-1] - 1)
    eigenvalues, vectors = np.linalg.eigh(values[..., 1:][..., place])
    with np.errstate(invalid="ignore"):
        square_roots = np.sqrt(eigenvalues)
    transposed = np.swapaxes(vectors, -1, -2)
    inner = transposed[..., None, :, :] @ np.moveaxis(gradients[..., 1:, :][..., place, :], -1, -3)
    inner = inner @ vectors[..., None, :, :]
    inner /= (square_roots[..., :, None] + square_roots[..., None, :])[..., None, :, :]
    change = np.moveaxis(vectors[..., None, :, :] @ inner @ transposed[..., None, :, :], -3, -1)
    root = (vectors * square_roots[..., None, :]) @ transposed
    slowness = np.exp(-values[..., 0])[..., None, None]
    return slowness * root, slowness[..., None] * (change - root[..., None] * gradients[..., None, :1, :])


def planar_roots(values: Float[np.ndarray, "*batch 4"], gradients: Float[np.ndarray, "*batch 4 variables"]) -> Roots:
    """Return the result of ``spectral_roots`` in the plane, in closed form.

    Q^(1/2) = (Q + δ I) / t, δ² = det Q, t² = tr Q + 2 δ. Source: Levinger 1980, The square root of a 2 × 2 matrix.
    """
    entries, change = values[..., 1:], gradients[..., 1:, :]
    a, b, d = entries[..., :1], entries[..., 1:2], entries[..., 2:]
    diagonal, cofactors = np.array([1.0, 0.0, 1.0]), np.array([1.0, -2.0, 1.0])  # ∂(a d − b²) = d ∂a − 2 b ∂b + a ∂d
    with np.errstate(invalid="ignore", divide="ignore"):
        delta = np.sqrt(a * d - b * b)
        square = a + d + 2 * delta
        factor = np.exp(-values[..., :1]) / np.sqrt(square)  # 1 / (s t)
        by_entry = entries[..., ::-1] * cofactors / (2 * delta)  # ∂δ / ∂(a, b, d)
        change = change + diagonal[:, None] * np.matmul(by_entry[..., None, :], change)
        trace_change = change[..., :1, :] + change[..., 2:, :]
        root = factor * (entries + diagonal * delta)
        relative = gradients[..., :1, :] + trace_change / (2 * square[..., None])
        change = factor[..., None] * change - root[..., None] * relative
    return root[..., PLANAR_PLACE], change[..., PLANAR_PLACE, :]


def upper_triangle(parts: int) -> Int[np.ndarray, "task task"]:
    """Return each entry's index in the packed upper triangle of a symmetric matrix."""
    task = int((np.sqrt(8 * parts + 1) - 1) / 2)
    place = np.zeros((task, task), dtype=int)
    place[np.triu_indices(task)] = np.arange(parts)
    return np.maximum(place, place.T)


PLANAR_PLACE = upper_triangle(3)


def check_model(model: object) -> None:
    """Raise InvalidInput unless ``model`` is a model of speeds."""
    if isinstance(model, type) or not all(hasattr(model, name) for name in ("lower", "upper", "roots")):
        raise InvalidInput(f"model must be a model of speeds, such as fit_ellipsoids returns, got {shown(model)}")
