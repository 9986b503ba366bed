"""What convex subproblems are made of, and how Clarabel is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import EvaluationFailed


@dataclass(frozen=True, kw_only=True, eq=False)
class Cone:
    """The number of a column is at least the length of values + rows · step; where step = 0 it is that length."""

    column: int
    values: Float[np.ndarray, " parts"]
    rows: sparse.csr_array


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """gaps + slopes · step ≥ 0, and cones; the length of a step is that of its first ``unknowns`` entries."""

    unknowns: int
    gaps: Float[np.ndarray, " limits"]
    slopes: sparse.csr_array
    cones: tuple[Cone, ...] = ()

    def in_reach(self, longest: float, *, order: int) -> np.ndarray:
        """Return which limits a step of the unknowns, of that length in the norm of ``order``, could reach."""
        own = abs(self.slopes[:, : self.unknowns])
        steep = np.asarray(own.sum(axis=1)).ravel() if order != 2 else _lengths(own)
        tied = np.diff(self.slopes[:, self.unknowns :].indptr) > 0
        found: np.ndarray = np.flatnonzero(tied | (self.gaps < steep * longest))
        return found

    @property
    def lengths(self) -> Float[np.ndarray, " limits"]:
        """Length of every limit's slope, at least a tiny one."""
        return np.maximum(_lengths(self.slopes), 1e-300)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """A solver's answer: the variables, the dual variables of all rows, and the value."""

    x: Float[np.ndarray, " variables"]
    dual: Float[np.ndarray, " rows"]
    value: float


def asked(
    what: str,
    quadratic: Any,
    linear: Float[np.ndarray, " variables"],
    blocks: Sequence[Any],
    right: Sequence[np.ndarray],
    cones: Sequence[Any],
    tolerance: float,
) -> Answer:
    """Return the answer to: least ½ xᵀ P x + q·x with right − blocks · x in the cones.

    Raises EvaluationFailed, naming ``what``, where there is none.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    matrix = sparse.csc_matrix(sparse.vstack([block for block in blocks if block.shape[0]], format="csc"))
    upper = sparse.csc_matrix(sparse.triu(quadratic, format="csc"))
    solver = clarabel.DefaultSolver(upper, linear, matrix, np.concatenate(right), list(cones), settings)
    found = solver.solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise EvaluationFailed(f"{what}: Clarabel wanted to end with Solved, got {found.status}")
    return Answer(x=np.array(found.x), dual=np.array(found.z), value=float(found.obj_val))


def _lengths(table: sparse.csr_array) -> np.ndarray:
    return np.sqrt(np.asarray(table.multiply(table).sum(axis=1)).ravel())
