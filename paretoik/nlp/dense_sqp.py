"""Small dense programs with a linear cost: the form in which fronts of postures and of paths hand them to solvers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.errors import EvaluationFailed
from paretoik.nlp.conic import Constraints, dense_rows
from paretoik.nlp.dense import DenseProgram, null_space
from paretoik.nlp.program import Goal
from paretoik.nlp.solutions import CONVERGED
from paretoik.nlp.sqp import SqpOptions, minimise
from paretoik.nlp.traced import Rows


@dataclass(frozen=True, kw_only=True, eq=False)
class Caps:
    """Linear functions of the unknowns that may not exceed what they are given: rows · z ≤ most."""

    rows: Float[np.ndarray, "caps unknowns"]
    most: Float[np.ndarray, " caps"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Minimum:
    """Where a search ended: unknowns, multipliers of inequalities and caps, the worst violation of any row.

    ``converged`` where no model promised more.
    """

    z: Float[np.ndarray, " unknowns"]
    limits: Float[np.ndarray, " inequalities"]
    violation: float
    converged: bool
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Local:
    """A program to first order about a place, along its equalities: z + ``basis`` · y."""

    z: Float[np.ndarray, " unknowns"]
    equal: Float[np.ndarray, " equalities"]
    room: Float[np.ndarray, " inequalities"]
    slopes: Float[np.ndarray, "inequalities unknowns"]
    basis: Float[np.ndarray, "unknowns freedoms"]
    back: Float[np.ndarray, "unknowns equalities"]

    @property
    def violation(self) -> float:
        """The worst violation of any row."""
        return _violation(self.equal, self.room)

    def constraints(self, room: Float[np.ndarray, " inequalities"]) -> Constraints:
        """Return the inequalities along the equalities, with what ``room`` they have."""
        return Constraints(unknowns=self.basis.shape[1], values=room, jacobian=dense_rows(self.slopes @ self.basis))


def local(program: Rows, z: Float[np.ndarray, " unknowns"], caps: Caps | None = None) -> Local:
    """Return the program to first order; caps come after its own inequalities.

    Raises EvaluationFailed where a row or a slope is not finite, or too few unknowns move the equalities.
    """
    (equal, room), table = rows_of(program, z, caps), slopes_of(program, z, caps)
    if not (np.isfinite(equal).all() and np.isfinite(room).all() and np.isfinite(table).all()):
        raise EvaluationFailed("program: finite rows and slopes wanted, got others")
    rows = len(equal)
    basis, back = null_space(table[:rows])
    return Local(z=z, equal=equal, room=room, slopes=table[rows:], basis=basis, back=back)


def minimised(
    program: Rows,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    *,
    caps: Caps | None = None,
    radius: float = 0.1,
    iterations: int = 200,
) -> Minimum:
    """Return a local minimum of cost · z below caps, from a place that is near the equalities, by quadratic programs.

    Raises EvaluationFailed where the program is not finite.
    """
    rows, most = (np.zeros((0, len(z))), np.zeros(0)) if caps is None else (caps.rows, caps.most)
    every = np.eye(1 + len(rows))
    dense = DenseProgram(rows=program, costs=np.concatenate([cost[None], rows]))
    options = SqpOptions(radius=radius, largest_radius=4 * radius, iterations=iterations, tolerance=1e-9)
    end = minimise(dense, z, Goal(weights=every[0], rows=every[1:], upper=most), options)
    return Minimum(
        z=end.x,
        limits=np.concatenate([end.multipliers, end.bound_multipliers]),
        violation=end.violation,
        converged=end.status == CONVERGED,
        iterations=end.iterations,
    )


def rows_of(program: Rows, z: np.ndarray, caps: Caps | None) -> tuple[np.ndarray, np.ndarray]:
    """Return equalities and inequalities, caps the last of them."""
    equal, room = program.rows(z)
    return equal, room if caps is None else np.append(room, caps.most - caps.rows @ z)


def slopes_of(program: Rows, z: np.ndarray, caps: Caps | None) -> Float[np.ndarray, "rows unknowns"]:
    """Return the Jacobian of the same rows."""
    table = program.jacobian(z)
    return table if caps is None else np.concatenate([table, -caps.rows])


def _violation(equal: np.ndarray, room: np.ndarray) -> float:
    return max(0.0, float(np.abs(equal).max(initial=0.0)), -float(room.min(initial=0.0)))
