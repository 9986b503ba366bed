"""Quartic splines through the positions ahead, C² at all of them and at rest at the end."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

DEGREE = 4


def quartic_spline(
    points: Float[np.ndarray, "points dof"], rate: Float[np.ndarray, " dof"], second: Float[np.ndarray, " dof"]
) -> Float[np.ndarray, "pieces 5 dof"]:
    """Return the coefficients of a quartic spline through points one unit of time from each other, C² at all of them.

    ``rate`` and ``second`` are its derivatives at the first; at the last both are 0 (with one piece only the first).
    With two pieces, as in the paper, that determines it; with more it has the least jerk.
    """
    pieces, dof = len(points) - 1, points.shape[1]
    conditions = np.concatenate([points[:-1], points[1:], rate[None], second[None]])
    return (_coefficient_matrix(pieces) @ conditions).reshape(pieces, DEGREE + 1, dof)


def spline_position(coefficients: Float[np.ndarray, "pieces 5 dof"], time: float) -> Float[np.ndarray, " dof"]:
    """Return the spline at a time in pieces; it stays at its end."""
    piece = min(int(time), len(coefficients) - 1)
    u = min(time - piece, 1.0)
    position: np.ndarray = u ** np.arange(DEGREE + 1) @ coefficients[piece]
    return position


@lru_cache(maxsize=32)
def _coefficient_matrix(pieces: int) -> np.ndarray:
    """Return the matrix from positions at all beginnings and ends, and derivatives at the first, to coefficients."""
    width, powers = DEGREE + 1, np.arange(DEGREE + 1)

    def derivative(order: int, u: float) -> np.ndarray:
        factors = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(width)
        return np.asarray(np.where(powers >= order, factors * float(u) ** np.maximum(powers - order, 0), 0.0))

    def condition(*parts: tuple[int, np.ndarray]) -> np.ndarray:
        row = np.zeros((pieces, width))
        for piece, values in parts:
            row[piece] = values
        return row.ravel()

    rows = [condition((i, derivative(0, u))) for u in (0, 1) for i in range(pieces)]
    rows += [condition((0, derivative(order, 0))) for order in (1, 2)]
    inhomogeneous = len(rows)
    rows += [condition((pieces - 1, derivative(order, 1))) for order in ((1, 2) if pieces > 1 else (1,))]
    for i in range(1, pieces):
        rows += [condition((i - 1, derivative(order, 1)), (i, -derivative(order, 0))) for order in (1, 2)]
    jerk = np.zeros((width, width))
    jerk[3:, 3:] = [[36.0, 72.0], [72.0, 192.0]]  # ∫ (6 c₃ + 24 c₄ u)² du
    size, equalities = pieces * width, np.array(rows)
    kkt = np.block([[np.kron(np.eye(pieces), jerk), equalities.T], [equalities, np.zeros((len(rows), len(rows)))]])
    return np.linalg.inv(kkt)[:size, size : size + inhomogeneous]
