"""The convex fit of ellipsoids: exact where it can be, below its samples where it must be, never worse than another."""

import numpy as np
import pytest

from paretoik.errors import SolverFailed
from paretoik.nlp.convex_programs import fit_inverse_squares, symmetric_basis

FLOOR = 1e-3


def circle(size):
    angles = np.pi * np.arange(size) / size
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def radii_of(design, parts, directions):
    products = np.einsum("ki,pij,kj->kp", directions, symmetric_basis(directions.shape[1]), directions)
    return (design @ parts @ products.T) ** -0.5


def error(design, parts, directions, radii):
    ratio = radii_of(design, parts, directions) / radii
    return np.sum((ratio - 1 / ratio) ** 2)


@pytest.fixture
def samples():
    """Two ellipses that share their unknowns, and samples that are 10 % off in either direction."""
    rng = np.random.default_rng(0)
    design, directions = np.array([[1.0, -0.5], [1.0, 0.5], [1.0, 0.0]]), circle(9)
    parts = np.array([[1.0, 0.2, 0.6], [0.3, 0.1, -0.2]])
    radii = radii_of(design, parts, directions)
    return design, directions, parts, radii, radii * np.exp(rng.uniform(-0.1, 0.1, size=radii.shape))


@pytest.mark.parametrize("size", [2, 3])
def test_the_basis_is_orthonormal_and_spans_the_symmetric_matrices(size):
    basis = symmetric_basis(size)
    assert np.einsum("pij,qij->pq", basis, basis) == pytest.approx(np.eye(size * (size + 1) // 2))
    matrix = np.arange(size * size, dtype=float).reshape(size, size)
    matrix += matrix.T
    assert np.tensordot(np.einsum("pij,ij->p", basis, matrix), basis, 1) == pytest.approx(matrix)


def test_ellipses_come_back_from_their_radii(samples):
    design, directions, parts, radii, _ = samples
    fitted = fit_inverse_squares(design, directions, radii, design, floor=FLOOR)
    assert fitted == pytest.approx(parts, abs=1e-5)


def test_a_bound_is_met_by_every_radius(samples):
    design, directions, _, _, radii = samples
    bounded = fit_inverse_squares(design, directions, radii, design, floor=FLOOR, bound=1.1)
    ratio = (radii / radii_of(design, bounded, directions)) ** 2
    assert ratio.min() == pytest.approx(1.1, abs=1e-8)


@pytest.mark.parametrize("bound", [None, 1.0])
def test_nothing_else_has_smaller_errors(samples, bound):
    design, directions, _, _, radii = samples
    fitted, rng = (
        fit_inverse_squares(design, directions, radii, design, floor=FLOOR, bound=bound),
        np.random.default_rng(1),
    )
    lowest_error = error(design, fitted, directions, radii)
    for size in np.geomspace(1e-4, 0.1, 40):
        other = fitted + size * rng.normal(size=fitted.shape)
        if bound is not None:  # lifted to where all radii are below the samples
            other = other * np.max((radii_of(design, other, directions) / radii) ** 2)
        assert error(design, other, directions, radii) > lowest_error


def test_matrices_stay_above_the_floor():
    directions = circle(3)
    radii = np.array([[10.0, 10.0, 1.0]])  # no ellipse with such radii has real axes
    (parts,) = fit_inverse_squares(np.ones((1, 1)), directions, radii, np.ones((1, 1)), floor=0.01)
    assert np.linalg.eigvalsh(np.tensordot(parts, symmetric_basis(2), 1))[0] == pytest.approx(0.01, rel=1e-4)


def test_numbers_that_have_no_fit_say_so():
    with pytest.raises(SolverFailed, match="ellipsoid fit: Clarabel should end with optimal"):
        fit_inverse_squares(np.ones((1, 1)), circle(3), np.ones((1, 3)), -np.ones((1, 1)), floor=0.01, bound=1.0)
