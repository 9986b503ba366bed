"""Small dense programs with steps along the null space of their equalities.

    minimise    weights · F(z),  F(z) = costs · z
    subject to  h(z) = 0,  c(z) ≥ 0

A step goes along an orthonormal basis of the null space of the equalities' Jacobian; Gauss–Newton steps with that
Jacobian's pseudoinverse lead back to the equalities. Source: Nocedal & Wright, Numerical Optimization, section 15.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import EvaluationFailed
from paretoik.nlp.dense.traced_rows import AssembledRows
from paretoik.nlp.program import Linearisation, dense_rows

EQUALITY_TOLERANCE = 1e-13  # largest error of a satisfied equality


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseProgram:
    """A program of unknowns z with equalities, inequalities and objectives F = costs · z."""

    rows: AssembledRows
    costs: Float[np.ndarray, "objectives unknowns"]
    objective_names: tuple[str, ...] = ()
    inequality_names: tuple[str, ...] = ()
    rounding: float = 0.0
    kinked: tuple[str, ...] = ()
    unsupported: tuple[()] = ()

    def project(self, x: Float[np.ndarray, "points unknowns"]) -> Float[np.ndarray, "points unknowns"]:
        """Return the points as they are."""
        return x

    def pin(self, x: Float[np.ndarray, "points unknowns"]) -> Float[np.ndarray, "points unknowns"]:
        """Return the points as they are."""
        return x

    @property
    def kernel(self) -> Any:
        """The program for compiled solvers."""
        from paretoik.nlp.dense import dense_kernel  # here: numba

        return dense_kernel.dense_kernel(self.rows, self.costs)

    @property
    def upper(self) -> Float[np.ndarray, " objectives"]:
        """Upper bounds of the objectives: none."""
        return np.full(len(self.costs), np.inf)

    def evaluate(
        self, x: Float[np.ndarray, " unknowns"]
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h and c."""
        equalities, inequalities = self.rows.rows(x)
        return self.costs @ x, equalities, inequalities

    def linearise(self, x: Float[np.ndarray, " unknowns"]) -> DenseLinearisation:
        """Return the program to first order at a point.

        Raises EvaluationFailed if a row or a derivative is not finite, or too few unknowns affect the equalities.
        """
        equalities, inequalities = self.rows.rows(x)
        jacobian = self.rows.jacobian(x)
        if not all(np.isfinite(part).all() for part in (equalities, inequalities, jacobian)):
            raise EvaluationFailed("program must have finite rows and derivatives, got inf or nan")
        basis, pseudoinverse = null_space(jacobian[: len(equalities)])
        return DenseLinearisation(
            program=self,
            x=x,
            unknowns=basis.shape[1],
            elastic=len(inequalities),
            objectives=self.costs @ x,
            equalities=equalities,
            inequalities=inequalities,
            basis=basis,
            pseudoinverse=pseudoinverse,
            gradients=self.costs @ basis,
            inequality_jacobian=jacobian[len(equalities) :],
            jacobian=dense_rows(jacobian[len(equalities) :] @ basis),
        )

    def kinks_at(self, x: Float[np.ndarray, " unknowns"]) -> tuple[str, ...]:
        """Return no names: all kinks have their own unknowns."""
        return ()

    def distance(
        self, x: Float[np.ndarray, " unknowns"], others: Float[np.ndarray, "others unknowns"]
    ) -> Float[np.ndarray, " others"]:
        """Return the Euclidean distance of a point from others."""
        return np.asarray(np.linalg.norm(others - x, axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseLinearisation(Linearisation):
    """A dense program to first order at z: a step y leads to z + basis · y; all inequalities are elastic."""

    program: DenseProgram
    basis: Float[np.ndarray, "unknowns columns"]
    pseudoinverse: Float[np.ndarray, "unknowns equalities"]
    inequality_jacobian: Float[np.ndarray, "inequalities unknowns"]

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian along the basis."""
        assert not cone_multipliers, "dense programs have no cones"
        gradient = weights @ self.program.costs - multipliers @ self.inequality_jacobian
        equality_multipliers = -self.pseudoinverse.T @ gradient
        hessian = self.program.rows.hessian(self.x, np.concatenate([equality_multipliers, -multipliers]))
        return dense_rows(self.basis.T @ hessian @ self.basis)

    def retract(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, " unknowns"] | None:
        """Return the point on the equalities, or nearer to them, that a step leads to; None if it is not finite."""
        x = self.x + self.basis @ step
        for _ in range(6):  # Gauss–Newton steps with one Jacobian
            equalities = self.program.rows.rows(x)[0]
            if not np.isfinite(equalities).all():
                return None
            if float(np.abs(equalities).max(initial=0.0)) < EQUALITY_TOLERANCE:
                break
            x = x - self.pseudoinverse @ equalities
        return x if np.isfinite(x).all() else None

    def corrected_inequalities(
        self, step: Float[np.ndarray, " columns"], x: Float[np.ndarray, " unknowns"]
    ) -> Float[np.ndarray, " inequalities"]:
        """Return c at the point x that a step led to."""
        return self.program.rows.rows(x)[1]


def null_space(
    jacobian: Float[np.ndarray, "equalities unknowns"],
) -> tuple[Float[np.ndarray, "unknowns columns"], Float[np.ndarray, "unknowns equalities"]]:
    """Return an orthonormal basis of the null space and the pseudoinverse, by QR decomposition.

    An unknown in no equality is a basis vector. Raises EvaluationFailed if too few unknowns affect the equalities.
    """
    rows, size = jacobian.shape
    nonzero = jacobian.any(axis=0)
    count = int(np.count_nonzero(nonzero))
    if count < rows:
        raise EvaluationFailed(f"program must have at least {rows} unknowns that affect its equalities, got {count}")
    orthogonal, upper = np.linalg.qr(jacobian[:, nonzero].T, mode="complete")
    basis, pseudoinverse = np.zeros((size, size - rows)), np.zeros((size, rows))
    basis[nonzero, : count - rows] = orthogonal[:, rows:]
    basis[~nonzero, count - rows :] = np.eye(size - count)
    pseudoinverse[nonzero] = np.linalg.lstsq(upper[:rows], orthogonal[:, :rows].T, rcond=None)[0].T
    return basis, pseudoinverse
