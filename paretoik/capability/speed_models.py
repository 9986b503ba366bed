"""How fast the tool can go: where, and in which direction, as a smooth model of directional maxima.

Directional maxima come as polygons (unions over postures, not convex), one at each position looked at. A model is an
ellipse or ellipsoid at every position. Source: Kim, Choi & Jang 2021, Model-predictive-control-based time-optimal
trajectory planning of the distributed actuation mechanism, section 3.1 and Eq. 5. ``speed_fits`` fits them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import InvalidInput

TOLD_APART = 1e-9  # share of the largest singular value: smaller ones are none
UNIT = 1e-6  # how far from 1 the length of a direction may be
SMALLEST = 1e-300  # in place of nothing, where something that is nothing too is divided


@runtime_checkable
class SpeedModel(Protocol):
    """Ellipsoids of tool velocity: at p those v with ‖R(p) v‖ ≤ 1, so that a path takes the time ∫ ‖R(p) dp‖.

    ``lower`` and ``upper`` (task,) [m] are the corners of the box of positions that it holds in.
    """

    @property
    def lower(self) -> Float[np.ndarray, " task"]: ...  # noqa: D102  read only: models are frozen

    @property
    def upper(self) -> Float[np.ndarray, " task"]: ...  # noqa: D102

    def roots(
        self, positions: Float[np.ndarray, "*batch task"]
    ) -> tuple[Float[np.ndarray, "*batch task task"], Float[np.ndarray, "*batch task task task"]]:
        """Return R(p) [s/m] and ∂R/∂p [s/m²], the coordinate of p last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomials:
    """Polynomials of total ``degree`` in x = (p − center) / scale, a column of ``coefficients`` each.

    Its rows are the products of ``degree`` factors out of 1, x₁, x₂, …, in the order of ``factors``: 1, x₁, x₂, x₁²,
    x₁x₂, x₂² for two coordinates and degree 2.
    """

    degree: int
    center: Float[np.ndarray, " task"]
    scale: float
    coefficients: Float[np.ndarray, "terms columns"]

    def __call__(
        self, positions: Float[np.ndarray, "*batch task"]
    ) -> tuple[Float[np.ndarray, "*batch columns"], Float[np.ndarray, "*batch columns task"]]:
        """Return values and their derivatives by position [1/m]."""
        products = self.products(positions)
        found = (products @ self._table).reshape(*products.shape[:-1], -1, 1 + len(self.center))
        return found[..., 0], found[..., 1:]

    def products(self, positions: Float[np.ndarray, "*batch task"]) -> Float[np.ndarray, "*batch terms"]:
        """Return the products of factors, without coefficients."""
        x = np.ones((*positions.shape[:-1], 1 + len(self.center)))
        x[..., 1:] = (positions - self.center) / self.scale
        whole: np.ndarray = np.multiply.reduce(x[..., self._factors], axis=-1)
        return whole

    @cached_property
    def _factors(self) -> Int[np.ndarray, "terms degree"]:
        return factors(len(self.center), self.degree)

    @cached_property
    def _table(self) -> Float[np.ndarray, "terms numbers"]:
        """Coefficients of values and derivatives, so that one product gives both."""
        place = {tuple(row): index for index, row in enumerate(self._factors.tolist())}
        found = np.zeros((*self.coefficients.shape, 1 + len(self.center)))
        found[..., 0] = self.coefficients
        for row, index in place.items():
            for axis in set(row) - {0}:
                lowered = list(row)
                lowered[row.index(axis)] = 0  # a factor 1 in place of one x
                below = place[tuple(sorted(lowered))]
                found[below, :, axis] += row.count(axis) / self.scale * self.coefficients[index]
        return found.reshape(len(place), -1)


def factors(task: int, degree: int) -> Int[np.ndarray, "terms degree"]:
    """Return which ``degree`` out of 1 (index 0), x₁, x₂, … make each product up to that degree, the lowest first."""
    rows = list(combinations_with_replacement(range(1 + task), degree))
    return np.array(rows, dtype=int).reshape(len(rows), degree)


@dataclass(frozen=True, kw_only=True, eq=False)
class LogEllipsoids:
    """Ellipsoids vᵀ S⁻¹ v ≤ 1 with S = exp(L(p)) and polynomials for the entries of L: definite whatever these are.

    ``logs`` are the entries of L, row by row, symmetric, S in m²/s². Outside its box the model goes on as its
    polynomials do.
    """

    logs: Polynomials
    lower: Float[np.ndarray, " task"]
    upper: Float[np.ndarray, " task"]

    def roots(
        self, positions: Float[np.ndarray, "*batch task"]
    ) -> tuple[Float[np.ndarray, "*batch task task"], Float[np.ndarray, "*batch task task task"]]:
        """Return R = exp(−L/2) [s/m] and ∂R/∂p [s/m²], the coordinate of p last."""
        logs, slopes = self.logs(positions)
        task = len(self.lower)
        shape = (*logs.shape[:-1], task, task)
        power = planar_exponential if task == 2 else exponential
        return power(-0.5 * logs.reshape(shape), -0.5 * slopes.reshape(*shape, task))

    def speeds(
        self, positions: Float[np.ndarray, "*batch task"], directions: Float[np.ndarray, "directions task"]
    ) -> Float[np.ndarray, "*batch directions"]:
        """Return the largest speeds [m/s] at positions along unit vectors."""
        return speeds_along(self.roots(positions)[0], directions)

    def scaled(self, factor: float) -> LogEllipsoids:
        """Return the model with all speeds times a factor."""
        coefficients = self.logs.coefficients.copy()
        coefficients[0] += 2 * np.log(factor) * np.eye(len(self.lower)).ravel()
        return replace(self, logs=replace(self.logs, coefficients=coefficients))


@dataclass(frozen=True, kw_only=True, eq=False)
class AxesEllipses:
    """Ellipses by their radii a, b [m/s] and the angle c [rad] of the first, each a polynomial of the position.

    ``axes`` are a, b and c. As in the paper, with what is weak about it: c means the same as c + π, so where the
    ellipses turn around a position no polynomial follows it, and polynomials a and b may fall below zero.
    Source: Kim, Choi & Jang 2021, Eq. 5.
    """

    axes: Polynomials
    lower: Float[np.ndarray, " task"]
    upper: Float[np.ndarray, " task"]

    def roots(
        self, positions: Float[np.ndarray, "*batch 2"]
    ) -> tuple[Float[np.ndarray, "*batch 2 2"], Float[np.ndarray, "*batch 2 2 2"]]:
        """Return R [s/m] and ∂R/∂p [s/m²], the coordinate of p last.

        Raises InvalidInput where a radius is not positive, naming the position.
        """
        axes, slopes = self.axes(positions)
        if not np.all(axes[..., :2] > 0):
            index = tuple(np.argwhere(~np.all(axes[..., :2] > 0, axis=-1))[0])
            place = " ".join(f"{number:.6g}" for number in positions[index])
            raise InvalidInput(
                f"positions: an ellipse with radii above zero wanted, got a = {axes[index][0]:.4g} and "
                f"b = {axes[index][1]:.4g} m/s at [{place}] m"
            )
        inverse = 1.0 / axes[..., :2]
        change = -(inverse[..., None] ** 2) * slopes[..., :2, :]
        cosine, sine = np.cos(2 * axes[..., 2]), np.sin(2 * axes[..., 2])
        turn = np.stack([cosine, sine, sine, -cosine], axis=-1).reshape(*cosine.shape, 2, 2)
        further = np.stack([-sine, cosine, cosine, sine], axis=-1).reshape(*cosine.shape, 2, 2)
        apart, mean = (inverse @ [0.5, -0.5])[..., None, None], (inverse @ [0.5, 0.5])[..., None, None]
        return mean * np.eye(2) + apart * turn, (
            (change[..., 0, :] + change[..., 1, :])[..., None, None, :] / 2 * np.eye(2)[..., None]
            + (change[..., 0, :] - change[..., 1, :])[..., None, None, :] / 2 * turn[..., None]
            + 2 * (apart * further)[..., None] * slopes[..., 2, :][..., None, None, :]
        )

    def speeds(
        self, positions: Float[np.ndarray, "*batch 2"], directions: Float[np.ndarray, "directions 2"]
    ) -> Float[np.ndarray, "*batch directions"]:
        """Return the largest speeds [m/s] at positions along unit vectors. Raises InvalidInput as ``roots`` does."""
        return speeds_along(self.roots(positions)[0], directions)


def speeds_along(
    roots: Float[np.ndarray, "*batch task task"], directions: Float[np.ndarray, "directions task"]
) -> Float[np.ndarray, "*batch directions"]:
    """Return 1 / ‖R d‖ [m/s], the largest speeds along unit vectors d."""
    found: np.ndarray = 1.0 / np.linalg.norm(directions @ roots, axis=-1)
    return found


def symmetric(task: int) -> Float[np.ndarray, "parts task task"]:
    """Return symmetric matrices of length 1, at right angles to each other, that all others are sums of."""
    rows, columns = np.triu_indices(task)
    found = np.zeros((len(rows), task, task))
    found[np.arange(len(rows)), rows, columns] = np.where(rows == columns, 1.0, np.sqrt(0.5))
    return np.maximum(found, np.swapaxes(found, 1, 2))


def divided(values: Float[np.ndarray, "*batch task"]) -> Float[np.ndarray, "*batch task task"]:
    """Return (eᵃ − eᵇ) / (a − b) of every two values, eᵃ where they are equal."""
    larger = np.maximum(values[..., :, None], values[..., None, :])
    apart = np.maximum(np.abs(values[..., :, None] - values[..., None, :]), SMALLEST)
    found: np.ndarray = np.exp(larger) * (-np.expm1(-apart) / apart)
    return found


def exponential(
    exponents: Float[np.ndarray, "*batch task task"], slopes: Float[np.ndarray, "*batch task task columns"]
) -> tuple[Float[np.ndarray, "*batch task task"], Float[np.ndarray, "*batch task task columns"]]:
    """Return exp(G) of symmetric G, and its derivatives from those of G.

    Source: Daleckii & Krein 1965; Higham, Functions of Matrices, theorem 3.11.
    """
    values, vectors = np.linalg.eigh(exponents)
    across = np.swapaxes(vectors, -1, -2)
    inner = across[..., None, :, :] @ np.moveaxis(slopes, -1, -3) @ vectors[..., None, :, :]
    inner *= divided(values)[..., None, :, :]
    changes = vectors[..., None, :, :] @ inner @ across[..., None, :, :]
    return (vectors * np.exp(values)[..., None, :]) @ across, np.moveaxis(changes, -3, -1)


def planar_exponential(
    exponents: Float[np.ndarray, "*batch 2 2"], slopes: Float[np.ndarray, "*batch 2 2 columns"]
) -> tuple[Float[np.ndarray, "*batch 2 2"], Float[np.ndarray, "*batch 2 2 columns"]]:
    """Return what ``exponential`` does, three times as quickly for a hundred matrices of two rows.

    G = m I + N with N = [[a, b], [b, −a]], so that N² = h² I and e^G = e^m (cosh h I + sinh h / h N).
    """
    mean = (exponents[..., 0, 0] + exponents[..., 1, 1])[..., None] / 2
    a, b = (exponents[..., 0, 0] - exponents[..., 1, 1])[..., None] / 2, exponents[..., 0, 1, None]
    square = np.maximum(a**2 + b**2, SMALLEST)
    length, grown = np.sqrt(square), np.exp(mean)
    even, odd = grown * np.cosh(length), grown * (np.sinh(length) / length)
    along, aside = odd * a, odd * b
    power = np.empty_like(exponents)
    power[..., 0, 0], power[..., 1, 1] = (even + along)[..., 0], (even - along)[..., 0]
    power[..., 0, 1] = power[..., 1, 0] = aside[..., 0]

    mean_slope = (slopes[..., 0, 0, :] + slopes[..., 1, 1, :]) / 2
    a_slope, b_slope = (slopes[..., 0, 0, :] - slopes[..., 1, 1, :]) / 2, slopes[..., 0, 1, :]
    half = a * a_slope + b * b_slope  # of the slope of h²
    even_slope = even * mean_slope + odd * half
    odd_slope = odd * mean_slope + (even - odd) / square * half  # inexact for small h, where a and b make it vanish
    along_slope = odd_slope * a + odd * a_slope
    changes = np.empty_like(slopes)
    changes[..., 0, 0, :], changes[..., 1, 1, :] = even_slope + along_slope, even_slope - along_slope
    changes[..., 0, 1, :] = changes[..., 1, 0, :] = odd_slope * b + odd * b_slope
    return power, changes


def checked(positions: object, directions: object, speeds: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arrays as numbers. Raises InvalidInput unless they are speeds at positions along unit vectors."""
    places, ways = _table("positions", positions), _table("directions", directions)
    task = places.shape[1]
    if task not in (2, 3):
        raise InvalidInput(f"positions: two or three coordinates wanted, got {task}")
    if ways.shape[1] != task:
        raise InvalidInput(f"directions: {task} coordinates wanted, as positions have, got {ways.shape[1]}")
    lengths = np.linalg.norm(ways, axis=1)
    if np.any(np.abs(lengths - 1.0) > UNIT):
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        raise InvalidInput(f"directions: unit vectors wanted, got length {lengths[worst]:.6g} at direction {worst}")
    found = _table("speeds", speeds, finite=False)
    if found.shape != (len(places), len(ways)):
        raise InvalidInput(f"speeds: shape {(len(places), len(ways))} wanted, got {found.shape}")
    wrong = np.argwhere(~(np.isfinite(found) & (found > 0)))
    if len(wrong):
        place, way = wrong[0]
        raise InvalidInput(
            f"speeds: positive numbers wanted, got {found[place, way]} at position {place}, direction {way}"
        )
    return places, ways, found


def check_spanning(directions: Float[np.ndarray, "directions task"]) -> None:
    """Raise InvalidInput unless the directions determine an ellipsoid."""
    parts = symmetric(directions.shape[1])
    told = rank(np.einsum("ki,pij,kj->kp", directions, parts, directions))
    if told < len(parts):
        raise InvalidInput(
            f"directions: at least {len(parts)} wanted that determine an ellipsoid, opposite ones counted once, got "
            f"{len(directions)} that determine {told} of its {len(parts)} numbers"
        )


def rank(matrix: np.ndarray) -> int:
    """Return the rank of a matrix whose entries are about 1."""
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(sizes > TOLD_APART * sizes[0]))


def _table(name: str, numbers: object, *, finite: bool = True) -> np.ndarray:
    try:
        found: np.ndarray = np.array(numbers, dtype=float)
        if np.iscomplexobj(np.asarray(numbers)):
            raise TypeError
    except (TypeError, ValueError):
        raise InvalidInput(f"{name}: a table of numbers wanted, got {type(numbers).__name__}") from None
    if found.ndim != 2 or not found.size:
        raise InvalidInput(f"{name}: a table of rows and columns wanted, got shape {found.shape}")
    if finite and not np.all(np.isfinite(found)):
        row, column = np.argwhere(~np.isfinite(found))[0]
        raise InvalidInput(f"{name}: finite numbers wanted, got {found[row, column]} in row {row}, column {column}")
    return found
