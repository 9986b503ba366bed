"""The paper's form of the speed model: radii and an angle, each a polynomial, fitted in two stages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from paretoik.capability.ellipsoid_fits import ellipsoids_at
from paretoik.capability.polynomials import empty_polynomials, orthogonal_design
from paretoik.capability.speed_models import AxesEllipses
from paretoik.capability.speed_samples import Directions, Positions, Speeds, checked_samples
from paretoik.errors import InvalidInput


def fit_axes(positions: Positions, directions: Directions, speeds: Speeds) -> AxesEllipses:
    """Return the paper's model, fitted in two stages as there: the ellipse of each position, then polynomials.

    Arguments are those of ``fit_ellipsoids``, in the plane alone. Raises InvalidInput as that does, and where the
    positions are not in the plane; SolverFailed as that does. The radii a ≥ b and the angle c of each
    ellipse are those of least relative errors; c is continued from each position to its nearest neighbours.
    Source: Kim, Choi & Jang 2021, Eq. 5 and section 3.1.
    """
    positions, directions, speeds = checked_samples(positions, directions, speeds)
    if positions.shape[1] != 2:
        raise InvalidInput(f"positions: two coordinates wanted for ellipses, got {positions.shape[1]}")
    empty = empty_polynomials(positions, 2)  # the degree of section 3.1
    design, triangular = orthogonal_design(empty, positions)
    squares, vectors = np.linalg.eigh(ellipsoids_at(directions, speeds))
    major, minor = 1.0 / np.sqrt(squares.T)
    angles = continued_angles(positions, np.arctan2(vectors[:, 1, 0], vectors[:, 0, 0]))
    for _ in angles:  # the squared errors fall every time, or stay from here on
        fitted = design @ (design.T @ angles) / len(positions)
        angles = angles + np.pi * np.round((fitted - angles) / np.pi)
    coefficients = np.linalg.solve(triangular, design.T @ np.stack([major, minor, angles], axis=1)) / len(positions)
    axes = replace(empty, coefficients=coefficients)
    return AxesEllipses(axes=axes, lower=positions.min(axis=0), upper=positions.max(axis=0))


def continued_angles(positions: Positions, angles: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    """Return angles plus multiples of π, each the nearest to that of a neighbour, along a shortest spanning tree."""
    weights = 1.0 + np.linalg.norm(positions[:, None] - positions, axis=-1)  # the same tree; 0 would mean no edge
    order, parents = breadth_first_order(minimum_spanning_tree(weights), 0, directed=False)
    continued = angles.copy()
    for index in order[1:]:
        continued[index] -= np.pi * np.round((continued[index] - continued[parents[index]]) / np.pi)
    return continued
