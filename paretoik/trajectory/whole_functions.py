"""Functions that relate samples of a motion to one another: dense derivatives.

Such a function is a sum of the largest of some numbers, or of one, or a factor times the length of a vector: these
numbers, its ``parts``, are smooth. Derivatives are taken by all positions and rates of all samples; second ones along
directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.autodiff.differentiation import dependencies, gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.operations import Op
from paretoik.autodiff.rewriting import norm_terms, smooth_pieces, summands
from paretoik.autodiff.tape import Tape, as_entry


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeFunction:
    """A function of all u (orders · time · dof), in this order: the sum of the largest of each group, or a length.

    ``groups`` says where each group's parts begin; it is empty where the function is ``factor`` times their length.
    ``jacobian_evaluator`` gives the derivatives of parts ``rows`` by inputs ``columns``. ``hessian_evaluator`` takes u,
    a direction in u and a multiplier a part, and gives the entries ``hessian_columns`` of the Hessian of
    Σ multiplier · part times the direction.
    """

    name: str
    groups: Int[np.ndarray, " groups"]
    factor: float
    parts: int
    value: Evaluator
    jacobian_evaluator: Evaluator
    rows: Int[np.ndarray, " entries"]
    columns: Int[np.ndarray, " entries"]
    hessian_evaluator: Evaluator
    hessian_columns: Int[np.ndarray, " second"]
    inputs: int

    def combine(self, values: Float[np.ndarray, " parts"]) -> float:
        """Return the function's value at values of its parts."""
        if not len(self.groups):
            return self.factor * float(np.linalg.norm(values))
        return float(np.maximum.reduceat(values, self.groups).sum())

    @property
    def slices(self) -> list[slice]:
        """The parts of every group."""
        return [slice(a, b) for a, b in pairwise([*self.groups.tolist(), self.parts])]

    @property
    def epigraph_columns(self) -> int:
        """Number of its epigraph variables: one for every group of several parts, one for a length."""
        return sum(part.stop - part.start > 1 for part in self.slices) if len(self.groups) else 1

    def jacobian(self, u: Float[np.ndarray, " inputs"]) -> sparse.csr_array:
        """Return the derivatives (parts, inputs) of the parts."""
        entries = self.jacobian_evaluator(u[:, None])[:, 0]
        return sparse.csr_array(sparse.coo_array((entries, (self.rows, self.columns)), shape=(self.parts, self.inputs)))

    def hessian_along(
        self, u: Float[np.ndarray, " inputs"], directions: sparse.csr_array, multipliers: Float[np.ndarray, " parts"]
    ) -> Float[np.ndarray, "columns columns"]:
        """Return Dᵀ H D for directions D (inputs, columns), H the second derivatives of Σ multipliers · parts."""
        if not len(self.hessian_columns):
            return np.zeros((directions.shape[1], directions.shape[1]))
        dense = directions.toarray()
        columns = dense.shape[1]
        fixed = np.concatenate([u[:, None], multipliers[:, None]])
        inputs = np.concatenate([np.repeat(fixed[: len(u)], columns, 1), dense, np.repeat(fixed[len(u) :], columns, 1)])
        along = self.hessian_evaluator(inputs)
        product: np.ndarray = dense[self.hessian_columns].T @ along
        return (product + product.T) / 2


def whole_function(tape: Tape, name: str, value: object) -> WholeFunction:
    """Return a function traced on a tape whose inputs are all u."""
    entry, count = as_entry(tape, value), len(tape.inputs)
    norm = norm_terms(tape, entry)
    groups = _groups(tape, entry) if norm is None else []
    parts = [part for group in groups for part in group] if norm is None else norm[1]
    zero, entries = tape.constant(0.0), []
    for k, part in enumerate(parts):
        inputs = [i for i in dependencies(tape, [part]) if tape.entries[i][0] is Op.INPUT]
        slopes = gradient(tape, part, inputs)
        entries += [(k, tape.entries[i][1], slope) for i, slope in zip(inputs, slopes, strict=True) if slope != zero]
    directions = [tape.input().index for _ in range(count)]
    total = zero
    for part in parts:
        total = tape.apply(Op.ADD, total, tape.apply(Op.MULTIPLY, tape.input().index, part))
    columns = sorted({j for _, j, _ in entries})
    slopes = gradient(tape, total, [tape.inputs[j] for j in columns])
    along = tangents(tape, slopes, {tape.inputs[j]: directions[j] for j in columns})
    second = [(j, entry) for j, entry in zip(columns, along, strict=True) if entry != zero]
    places = np.array([(k, j) for k, j, _ in entries], dtype=np.int64).reshape(-1, 2)
    return WholeFunction(
        name=name,
        groups=np.cumsum([0, *map(len, groups)], dtype=np.int64)[:-1] if groups else np.empty(0, dtype=np.int64),
        factor=1.0 if norm is None else norm[0],
        parts=len(parts),
        value=compile_evaluator(tape, parts),
        jacobian_evaluator=compile_evaluator(tape, [slope for *_, slope in entries]),
        rows=places[:, 0],
        columns=places[:, 1],
        hessian_evaluator=compile_evaluator(tape, [entry for _, entry in second]),
        hessian_columns=np.array([j for j, _ in second], dtype=np.int64),
        inputs=count,
    )


def _groups(tape: Tape, entry: int) -> list[list[int]]:
    """Return the smooth addends as one, then the pieces of every addend with kinks."""
    smooth, groups = tape.constant(0.0), list[list[int]]()
    for term in summands(tape, entry):
        pieces = smooth_pieces(tape, term)
        if len(pieces) > 1:
            groups.append(pieces)
        else:
            smooth = tape.apply(Op.ADD, smooth, term)
    return [[smooth], *groups]
