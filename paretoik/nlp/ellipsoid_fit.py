"""Ellipsoids fitted to radii along directions: a convex program, stated in cvxpy and solved by Clarabel.

An ellipsoid vᵀ P v ≤ 1 has the radius ρ = (dᵀ P d)^(−1/2) along the unit vector d. With x = (r / ρ)² = r² dᵀ P d,
linear in P, the symmetric relative error (ρ/r − r/ρ)² = x + 1/x − 2 of a sample r is convex, and ρ ≤ r is the linear
constraint x ≥ 1. Several ellipsoids, linear in common unknowns C, are fitted together:

    minimise    Σ_ik  x_ik + 1/x_ik − 2,    x_ik = squares_ik · (design C)_i · products_k
    subject to  x_ik ≥ bound                (where radii are bounded by the samples)
                Σ_p (definite C)_jp E_p ⪰ floor · I  for every j

E_p are symmetric matrices of unit length; ``symmetric_basis`` returns them.
"""

from __future__ import annotations

import warnings

import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed

GAP_TOLERANCE = 1e-11  # of the mean squared error: errors themselves are found to about its square root


def symmetric_basis(size: int) -> Float[np.ndarray, "parts size size"]:
    """Return an orthonormal basis of the symmetric matrices, in the Frobenius norm."""
    rows, columns = np.triu_indices(size)
    basis = np.zeros((len(rows), size, size))
    basis[np.arange(len(rows)), rows, columns] = np.where(rows == columns, 1.0, np.sqrt(0.5))
    return np.maximum(basis, np.swapaxes(basis, 1, 2))


def fit_inverse_squares(
    design: Float[np.ndarray, "samples terms"],
    directions: Float[np.ndarray, "directions size"],
    radii: Float[np.ndarray, "samples directions"],
    definite: Float[np.ndarray, "points terms"],
    *,
    floor: float,
    bound: float | None = None,
) -> Float[np.ndarray, "terms parts"]:
    """Return the coefficients C of the ellipsoids with the least symmetric relative errors.

    ``radii`` should be of the order 1. ``bound`` is the least (r / ρ)² allowed, None for no bound.

    Raises SolverFailed where Clarabel finds no solution.
    """
    import cvxpy  # here: it takes two seconds

    parts = symmetric_basis(directions.shape[1])
    products = np.einsum("ki,pij,kj->kp", directions, parts, directions)
    coefficients = cvxpy.Variable((design.shape[1], len(parts)))
    x = cvxpy.multiply(radii**2, design @ coefficients @ products.T)
    constraints = [] if bound is None else [x >= bound]
    bounded = definite @ coefficients
    for j in range(len(definite)):
        matrix = sum(bounded[j, p] * parts[p] for p in range(len(parts)))
        constraints.append(matrix >> floor * np.eye(directions.shape[1]))
    error = cvxpy.sum(x) + cvxpy.sum(cvxpy.inv_pos(x)) - 2 * radii.size
    problem = cvxpy.Problem(cvxpy.Minimize(error / radii.size), constraints)
    tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), GAP_TOLERANCE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # an inaccurate solution is judged by its status
        problem.solve(solver=cvxpy.CLARABEL, **tolerances)
    if problem.status not in (cvxpy.OPTIMAL, cvxpy.OPTIMAL_INACCURATE):
        raise SolverFailed(f"ellipsoid fit: Clarabel should end with optimal, ended with {problem.status}")
    return np.array(coefficients.value)
