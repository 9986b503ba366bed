"""Ellipsoids fitted to directional maxima: one convex program for all positions, or the paper's two stages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from paretoik.capability.speed_models import (
    AxesEllipses,
    PolynomialEllipsoids,
    SpeedModel,
    check_model,
    empty_polynomials,
    numerical_rank,
    orthogonal_design,
    speeds_along,
)
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import check_flag, finite_array, real_array, shown
from paretoik.nlp.convex_programs import fit_inverse_squares, symmetric_basis
from paretoik.tables import represented

# Checked samples of directional maxima, and the error of a model at them.


Positions: TypeAlias = Float[np.ndarray, "samples task"]
Directions: TypeAlias = Float[np.ndarray, "directions task"]
Speeds: TypeAlias = Float[np.ndarray, "samples directions"]


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class FitErrors:
    """Relative errors of a model's speeds: 0.1 is 10 %.

    ``overestimate`` is the largest error above the true speed, at ``position`` [m] along ``direction``; it is negative
    if the model is below everywhere. ``underestimate`` is the largest error below the true speed.
    """

    rms: float
    overestimate: float
    underestimate: float
    position: Float[np.ndarray, " task"]
    direction: Float[np.ndarray, " task"]


def fit_errors(model: SpeedModel, positions: Positions, directions: Directions, speeds: Speeds) -> FitErrors:
    """Return the errors of a model at directional maxima [m/s].

    Use positions that were not fitted. Raises InvalidInput if the shapes of the arrays differ, or speeds are
    not positive.
    """
    check_model(model)
    positions, directions, speeds = checked_samples(positions, directions, speeds)
    if positions.shape[1] != len(model.lower):
        raise InvalidInput(f"positions must have {len(model.lower)} coordinates, got {positions.shape[1]}")
    errors = speeds_along(model.roots(positions)[0], directions) / speeds - 1.0
    sample, k = np.unravel_index(np.argmax(errors), errors.shape)
    return FitErrors(
        rms=float(np.sqrt(np.mean(errors**2))),
        overestimate=float(errors.max()),
        underestimate=float(-errors.min()),
        position=positions[sample],
        direction=directions[k],
    )


def checked_samples(positions: object, directions: object, speeds: object) -> tuple[Positions, Directions, Speeds]:
    """Return the arrays as numbers; raises InvalidInput unless they are positions, unit vectors and speeds."""
    places, vectors = _matrix("positions", positions), _matrix("directions", directions)
    task = places.shape[1]
    if task not in (2, 3):
        raise InvalidInput(f"positions must have two or three coordinates, got {task}")
    if vectors.shape[1] != task:
        raise InvalidInput(f"directions must have {task} coordinates, as positions have, got {vectors.shape[1]}")
    lengths = np.linalg.norm(vectors, axis=1)
    if np.any(np.abs(lengths - 1.0) > 1e-6):  # more than rounding
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        raise InvalidInput(f"directions must be unit vectors, got length {lengths[worst]:.6g} at direction {worst}")
    values = _matrix("speeds", speeds, finite=False)
    if values.shape != (len(places), len(vectors)):
        raise InvalidInput(f"speeds must have shape {(len(places), len(vectors))}, got {values.shape}")
    wrong = np.argwhere(~(np.isfinite(values) & (values > 0)))
    if len(wrong):
        sample, k = wrong[0]
        raise InvalidInput(
            f"speeds must be positive numbers, got {values[sample, k]} at position {sample}, direction {k}"
        )
    return places, vectors, values


def check_determined(directions: Directions) -> None:
    """Raise InvalidInput unless the directions determine an ellipsoid."""
    rows, columns = np.triu_indices(directions.shape[1])
    rank = numerical_rank(directions[:, rows] * directions[:, columns])
    if rank < len(rows):
        raise InvalidInput(
            f"directions must determine the {len(rows)} numbers of an ellipsoid, opposite ones counted once, got "
            f"{len(directions)} that determine {rank}"
        )


def _matrix(name: str, numbers: object, *, finite: bool = True) -> np.ndarray:
    matrix = real_array(name, numbers)
    if matrix.ndim != 2 or not matrix.size:
        raise InvalidInput(f"{name} must be a table of rows and columns, got shape {matrix.shape}")
    if finite and not np.all(np.isfinite(matrix)):
        row, column = np.argwhere(~np.isfinite(matrix))[0]
        raise InvalidInput(f"{name} must be finite numbers, got {matrix[row, column]} in row {row}, column {column}")
    return matrix


# Fits of ellipsoids to directional maxima.


@dataclass(frozen=True, kw_only=True)
class EllipsoidFitOptions:
    """Settings of the fits of ellipsoids, measured on the data of ``studies.kim_2021``."""

    longest: float = 30.0  # largest radius of an ellipsoid within the box, in radii of the ball of equal volume
    needle: float = 10.0  # radius at a sample, per largest speed there, above which directions do not determine it
    clearance: float = 1e-12  # distance of log speeds of a safe fit from their bounds, against rounding


OPTIONS = EllipsoidFitOptions()


def fit_ellipsoids(
    positions: Positions,
    directions: Directions,
    speeds: Speeds,
    *,
    degree: int = 2,
    safe: bool = False,
    margin: float = 0.0,
) -> PolynomialEllipsoids:
    """Return the ellipsoid model of least relative errors.

    It minimises Σ (fitted / true − true / fitted)²: to first order four times the squared errors. The program is convex
    in P, the inverse square of the ellipsoid (``nlp.convex_programs``), so that the fit is the best of its kind. The
    scale s(p) is fitted first, by linear least squares: log s is that of the ball with the volume of the directional
    maxima. Loading cvxpy takes about two seconds. Source: Kim, Choi & Jang 2021, Eq. 5, with P in place of radii and an
    angle.

    positions: positions (samples, task) [m], task 2 or 3
    directions: unit vectors (directions, task), evenly spread, for instance 32 in the plane for safe fits; opposite
        ones add nothing
    speeds: directional maxima (samples, directions) [m/s]
    degree: total degree of the polynomials
    safe: whether to satisfy log(fitted / true) ≤ −margin at every sample; it is not certain elsewhere
    margin: margin of a safe fit, at least 0; 0.02 is about 2 %

    Raises InvalidInput for arrays whose shapes differ, speeds that are not positive, and positions or directions that
    do not determine the model; SolverFailed if directions do not determine the solution, or no solution exists.
    """
    if not finite_array("margin", margin, ()) >= 0.0 or (margin > 0.0 and not safe):
        raise InvalidInput(f"margin must be a finite number of at least 0, and 0 unless safe, got {shown(margin)}")
    check_flag("safe", safe)
    positions, directions, speeds = checked_samples(positions, directions, speeds)
    empty = empty_polynomials(positions, degree)
    design, triangular = orthogonal_design(empty, positions)
    check_determined(directions)
    log_scale = design.T @ log_volume_radii(speeds, directions.shape[1]) / len(positions)
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    parts = fit_inverse_squares(
        design,
        directions,
        speeds / np.exp(design @ log_scale)[:, None],
        np.linalg.solve(triangular.T, empty.bernstein(lower, upper).T).T,
        floor=OPTIONS.longest**-2,
        bound=np.exp(2 * margin) if safe else None,
    )
    task = directions.shape[1]
    entries = np.tensordot(parts, symmetric_basis(task), 1)[:, *np.triu_indices(task)]
    columns = np.linalg.solve(triangular, np.column_stack([log_scale, entries]))
    model = PolynomialEllipsoids(polynomials=replace(empty, coefficients=columns), lower=lower, upper=upper)
    check_needles(np.linalg.svd(model.roots(positions)[0])[1].min(axis=1), speeds)
    if safe:  # the solver is exact to its tolerance only: shift to be safe up to rounding
        excess = float(np.log(model.speeds(positions, directions) / speeds).max())
        model = model.scaled(np.exp(-margin - OPTIONS.clearance - excess))
    return model


def fit_axes(positions: Positions, directions: Directions, speeds: Speeds) -> AxesEllipses:
    """Return the paper's model, fitted in two stages.

    The stages are the ellipse of each position, then polynomials. Arguments and errors are those of ``fit_ellipsoids``;
    it also raises InvalidInput if positions are not in the plane. The radii a ≥ b and the angle c of each ellipse are
    those of least relative errors; c is made continuous along a shortest spanning tree of positions. Source: Kim, Choi
    & Jang 2021, Eq. 5 and section 3.1.
    """
    positions, directions, speeds = checked_samples(positions, directions, speeds)
    if positions.shape[1] != 2:
        raise InvalidInput(f"positions must have two coordinates for ellipses, got {positions.shape[1]}")
    empty = empty_polynomials(positions, 2)  # the degree of section 3.1
    design, triangular = orthogonal_design(empty, positions)
    squares, vectors = np.linalg.eigh(ellipsoids_at(directions, speeds))
    major, minor = 1.0 / np.sqrt(squares.T)
    # Each angle is the nearest, modulo π, to that of a neighbour along a shortest spanning tree.
    angles = np.arctan2(vectors[:, 1, 0], vectors[:, 0, 0])
    distances = 1.0 + np.linalg.norm(positions[:, None] - positions, axis=-1)  # + 1, since 0 means no edge: same tree
    order, parents = breadth_first_order(minimum_spanning_tree(distances), 0, directed=False)
    for index in order[1:]:
        angles[index] -= np.pi * np.round((angles[index] - angles[parents[index]]) / np.pi)
    for _ in angles:  # every iteration reduces the squared errors, until they no longer change
        fitted = design @ (design.T @ angles) / len(positions)
        angles = angles + np.pi * np.round((fitted - angles) / np.pi)
    coefficients = np.linalg.solve(triangular, design.T @ np.stack([major, minor, angles], axis=1)) / len(positions)
    axes = replace(empty, coefficients=coefficients)
    return AxesEllipses(axes=axes, lower=positions.min(axis=0), upper=positions.max(axis=0))


def ellipsoids_at(directions: Directions, speeds: Speeds) -> Float[np.ndarray, "samples task task"]:
    """Return the inverse square P [s²/m²] of every position's ellipsoid, fitted to its own speeds only."""
    check_determined(directions)
    task, each = directions.shape[1], np.eye(len(speeds))
    scale = np.exp(log_volume_radii(speeds, task))
    parts = fit_inverse_squares(each, directions, speeds / scale[:, None], each, floor=OPTIONS.longest**-2)
    matrices = np.tensordot(parts, symmetric_basis(task), 1) / scale[:, None, None] ** 2
    check_needles(np.sqrt(np.linalg.eigvalsh(matrices)[:, 0]), speeds)
    return matrices


def log_volume_radii(speeds: Speeds, task: int) -> Float[np.ndarray, " samples"]:
    """Return the log radius of a ball with the volume within speeds along evenly spread directions."""
    largest = speeds.max(axis=1, keepdims=True)  # divided out, because its powers may overflow
    return np.asarray(np.log(np.mean((speeds / largest) ** task, axis=1)) / task + np.log(largest[:, 0]))


def check_needles(slowness: Float[np.ndarray, " samples"], speeds: Speeds) -> None:
    """Raise SolverFailed if an ellipsoid, of longest radius 1 / slowness [m/s], is far longer than the speeds."""
    ratio = 1.0 / (slowness * speeds.max(axis=1))
    if not ratio.max() <= OPTIONS.needle:
        raise SolverFailed(
            f"speeds must give radii of at most {OPTIONS.needle:g} times the largest speed, got {ratio.max():.3g} at "
            f"position {np.argmax(ratio)}; give more directions"
        )
