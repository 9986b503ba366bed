"""Polynomials of a position, several at once, with their derivatives and their bounds over a box."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, product
from math import comb

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import InvalidInput
from paretoik.inputs import check_size


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomials:
    """Polynomials of total ``degree`` in x = (p − center) / scale, a column of ``coefficients`` each.

    Its rows are the monomials, the products of ``degree`` factors out of 1, x₁, x₂, …, in the order of ``monomials``:
    1, x₁, x₂, x₁², x₁x₂, x₂² for two coordinates and degree 2.
    """

    degree: int
    center: Float[np.ndarray, " task"]
    scale: float
    coefficients: Float[np.ndarray, "terms columns"]

    def __call__(
        self, positions: Float[np.ndarray, "*batch task"]
    ) -> tuple[Float[np.ndarray, "*batch columns"], Float[np.ndarray, "*batch columns task"]]:
        """Return values and their derivatives by position [1/m]."""
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
        """Return the matrix from monomial coefficients to those in the tensor Bernstein basis of a box.

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
    """Return which ``degree`` out of 1 (index 0), x₁, x₂, … make each product up to that degree, the lowest first."""
    rows = list(combinations_with_replacement(range(1 + task), degree))
    return np.array(rows, dtype=int).reshape(len(rows), degree)


def empty_polynomials(positions: Float[np.ndarray, "samples task"], degree: int) -> Polynomials:
    """Return polynomials without columns, to be fitted at positions; one scale for all coordinates keeps axes equal.

    Raises InvalidInput unless the degree is a whole number from 0 on.
    """
    check_size("degree", degree, 0)
    center = positions.mean(axis=0)
    scale = float(np.linalg.norm(positions - center, axis=1).max()) or 1.0
    terms = len(monomials(positions.shape[1], degree))
    return Polynomials(degree=degree, center=center, scale=scale, coefficients=np.zeros((terms, 0)))


def orthogonal_design(
    polynomials: Polynomials, positions: Float[np.ndarray, "samples task"]
) -> tuple[Float[np.ndarray, "samples terms"], Float[np.ndarray, "terms terms"]]:
    """Return Q and R of the design matrix at positions, QᵀQ / samples = I.

    Raises InvalidInput where the positions do not determine the polynomials.
    """
    design, (size, task) = polynomials.design(positions), positions.shape
    terms = design.shape[1]
    wish = f"positions: at least {terms} wanted for polynomials of degree {polynomials.degree} in {task} coordinates"
    if size < terms:
        raise InvalidInput(f"{wish}, got {size}")
    rank = numerical_rank(design)
    if rank < terms:
        raise InvalidInput(f"{wish}, in general position, got {size} that determine only {rank} of {terms} terms")
    orthogonal, triangular = np.linalg.qr(design)
    return orthogonal * np.sqrt(size), triangular / np.sqrt(size)


def numerical_rank(matrix: np.ndarray, *, tolerance: float = 1e-9) -> int:
    """Return the rank: singular values up to ``tolerance`` of the largest count as 0."""
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(sizes > tolerance * sizes[0]))
