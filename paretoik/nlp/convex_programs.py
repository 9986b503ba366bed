"""Convex programs: ellipsoid fits, minimum-time moves of path points, and directional maxima."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.optimize import linprog

from paretoik.errors import SolverFailed
from paretoik.nlp.program import CLARABEL_TOLERANCE

# Ellipsoids fitted to radii along directions: a convex program in cvxpy, solved by Clarabel.
#
# An ellipsoid vᵀ P v ≤ 1 has the radius ρ = (dᵀ P d)^(−1/2) along the unit vector d. With x = (r / ρ)² = r² dᵀ P d,
# linear in P, the symmetric relative error (ρ/r − r/ρ)² = x + 1/x − 2 of a sample r is convex, and ρ ≤ r is the
# linear constraint x ≥ 1. Several ellipsoids, linear in common unknowns C, are fitted together:
#
#     minimise    Σ_ik  x_ik + 1/x_ik − 2,    x_ik = squares_ik · (design C)_i · products_k
#     subject to  x_ik ≥ bound                (if the samples bound the radii)
#                 Σ_p (definite C)_jp E_p ⪰ floor · I  for every j
#
# E_p are symmetric matrices of unit length; ``symmetric_basis`` returns them.


GAP_TOLERANCE = 1e-11  # share of the mean squared error; errors are exact to about its square root


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
    """Return the coefficients C of ellipsoids with the least symmetric relative errors.

    radii: radii r of the samples, of the order 1
    bound: least (r / ρ)² allowed, with ρ the ellipsoid's radius in the direction of r; None for no bound

    Raises SolverFailed if Clarabel finds no solution.
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
        raise SolverFailed(f"ellipsoid fit: Clarabel's status must be optimal, got {problem.status}")
    return np.array(coefficients.value)


# Moves of a path's points for the least time of its pieces: a second-order cone program that is solved repeatedly.
#
#     minimise    Σ ΔT(l)
#     subject to  ‖values(l) + before(l) d(l) + after(l) d(l+1)‖ ≤ ΔT(l)
#                 lower ≤ d ≤ upper,  d(0) = d(N) = 0
#
# d are the moves of the points between the ends. All pieces share one interval ΔT, or each has its own. Clarabel gets
# the program once, then only new data. It is assembled by hand because a controller solves it at every step: cvxpy
# took 1.9 times as long for five pieces. Tests compare it with a statement in cvxpy. Source: Kim, Choi & Jang 2021,
# Eq. 6, with its velocity limit linearised.


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Vectors whose lengths are the times of pieces; they are linear in the moves of end points.

    values: vectors of the path as it is [s]
    before: derivatives by the first point of a piece [s/m]
    after: derivatives by the last point of a piece [s/m]
    """

    values: Float[np.ndarray, "pieces task"]
    before: Float[np.ndarray, "pieces task task"]
    after: Float[np.ndarray, "pieces task task"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Moves:
    """Moves [m] of the points between the ends, and the interval [s] of every piece."""

    moves: Float[np.ndarray, "between task"]
    intervals: Float[np.ndarray, " pieces"]


class IntervalSolver:
    """The program for at least 2 pieces and ``task`` task coordinates; it reuses its solver."""

    def __init__(self, pieces: int, task: int, *, common: bool = True) -> None:
        self._pieces, self._task, self._unknowns = pieces, task, (pieces - 1) * task
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.presolve_enable = False  # presolve could drop rows; then data could not be updated
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = self._settings.tol_feas = CLARABEL_TOLERANCE
        self._solver: clarabel.DefaultSolver | None = None
        # rows and columns of entries: both sides of the box, intervals, ``before`` and ``after``
        unknowns = self._unknowns
        index = np.arange(unknowns)
        first = 2 * unknowns + np.arange(pieces) * (task + 1)  # row of each piece's cone
        interval = unknowns + (np.zeros(pieces, dtype=int) if common else np.arange(pieces))
        part, coordinate = np.indices((task, task)).reshape(2, -1)
        point = task * np.arange(pieces - 1)[:, None] + coordinate
        before, after = ((begin[:, None] + 1 + part).ravel() for begin in (first[1:], first[:-1]))
        row = np.concatenate([index, index + unknowns, first, before, after])
        column = np.concatenate([index, index, interval, point.ravel(), point.ravel()])
        self._order = np.lexsort((row, column))
        self._rows = row[self._order]
        self._linear = np.append(np.zeros(unknowns), np.ones(1 if common else pieces))
        self._begins = np.searchsorted(column[self._order], np.arange(len(self._linear) + 1))
        self._fixed = np.concatenate([np.ones(unknowns), np.full(unknowns + pieces, -1.0)])
        self._cones = [clarabel.NonnegativeConeT(2 * unknowns), *[clarabel.SecondOrderConeT(task + 1)] * pieces]

    def solve(
        self, pieces: Pieces, lower: Float[np.ndarray, "between task"], upper: Float[np.ndarray, "between task"]
    ) -> Moves:
        """Return the best moves [m] between finite ``lower`` ≤ 0 and ``upper`` ≥ 0.

        Raises SolverFailed if Clarabel finds none.
        """
        # in these units values and derivatives are about 1
        time = max(float(np.abs(pieces.values).max()), 1e-300)
        length = time / max(float(np.abs(pieces.after).max()), 1e-300)
        scaled = length / time
        entries = (self._fixed, -scaled * pieces.before[1:].ravel(), -scaled * pieces.after[:-1].ravel())
        matrix = np.concatenate(entries)[self._order]
        offsets = np.zeros((self._pieces, self._task + 1))
        offsets[:, 1:] = pieces.values / time
        right = np.concatenate([upper.ravel() / length, -lower.ravel() / length, offsets.ravel()])
        if self._solver is None:
            columns = len(self._linear)
            table = sparse.csc_matrix((matrix, self._rows, self._begins), shape=(len(right), columns))
            empty = sparse.csc_matrix((columns, columns))
            self._solver = clarabel.DefaultSolver(empty, self._linear, table, right, self._cones, self._settings)
        else:
            self._solver.update(A=matrix, b=right)
        solution = self._solver.solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            raise SolverFailed(f"minimum-time cone program: Clarabel's status must be Solved, got {solution.status}")
        x = np.array(solution.x)
        return Moves(
            moves=x[: self._unknowns].reshape(-1, self._task) * length,
            intervals=np.broadcast_to(x[self._unknowns :], self._pieces) * time,
        )


# The linear program of a directional maximum.


def furthest(
    columns: Float[np.ndarray, "task columns"],
    low: Float[np.ndarray, " columns"],
    high: Float[np.ndarray, " columns"],
    direction: Float[np.ndarray, " task"],
) -> tuple[float, Float[np.ndarray, " columns"]]:
    """Return the directional maximum v of columns · x, and the x that reaches it.

        maximise    v
        subject to  columns · x = v · direction,  low ≤ x ≤ high,  v ≥ 0

    SciPy's HiGHS solves it by the simplex method, which ends on a vertex, exact to rounding. Raises SolverFailed if
    there is no such point or v is unbounded.
    """
    scale = np.maximum(np.abs(low), np.abs(high))
    scale = np.where(scale > 0, scale, 1.0)
    steps = columns * scale
    size = float(np.abs(steps).max(initial=0.0)) or 1.0
    solution = linprog(
        np.append(np.zeros(len(low)), -1.0),
        A_eq=np.column_stack([steps / size, -direction]),
        b_eq=np.zeros(len(direction)),
        bounds=[*zip(low / scale, high / scale, strict=True), (0.0, None)],
        method="highs-ds",
    )
    if solution.status != 0:
        raise SolverFailed(f"directional maximum: HiGHS found no optimum: {solution.message}")
    return float(solution.x[-1]) * size, solution.x[:-1] * scale
