"""Functions of a whole motion, which look from one sample at another: dense derivatives.

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
class Whole:
    """A function of all u (orders · time · dof), in this order: the sum of the largest of each group, or a length.

    ``groups`` says where each group's parts begin; it is empty where the function is ``factor`` times their length.
    ``slope`` gives derivatives of parts ``part`` by inputs ``by``. ``curvature``, after u, takes a direction in u and
    a multiplier for each part, and gives the rate of change of Σ multiplier · slope along it by inputs ``by_second``.
    """

    name: str
    groups: Int[np.ndarray, " groups"]
    factor: float
    parts: int
    value: Evaluator
    slope: Evaluator
    part: Int[np.ndarray, " entries"]
    by: Int[np.ndarray, " entries"]
    curvature: Evaluator
    by_second: Int[np.ndarray, " second"]
    inputs: int

    def worth(self, values: Float[np.ndarray, " parts"]) -> float:
        """Return the function's value for values of its parts."""
        if not len(self.groups):
            return self.factor * float(np.linalg.norm(values))
        return float(np.maximum.reduceat(values, self.groups).sum())

    @property
    def spans(self) -> list[slice]:
        """The parts of every group."""
        return [slice(a, b) for a, b in pairwise([*self.groups.tolist(), self.parts])]

    @property
    def tops(self) -> int:
        """How many columns of its own the function takes: one for every group of several parts, one for a length."""
        return sum(span.stop - span.start > 1 for span in self.spans) if len(self.groups) else 1

    def slopes(self, u: Float[np.ndarray, " inputs"]) -> sparse.csr_array:
        """Return the derivatives (parts, inputs) of the parts."""
        found = self.slope(u[:, None])[:, 0]
        return sparse.csr_array(sparse.coo_array((found, (self.part, self.by)), shape=(self.parts, self.inputs)))

    def second(
        self, u: Float[np.ndarray, " inputs"], directions: sparse.csr_array, multipliers: Float[np.ndarray, " parts"]
    ) -> Float[np.ndarray, "columns columns"]:
        """Return Dᵀ H D for directions D (inputs, columns), H the second derivatives of Σ multipliers · parts."""
        if not len(self.by_second):
            return np.zeros((directions.shape[1], directions.shape[1]))
        dense = directions.toarray()
        columns = dense.shape[1]
        fixed = np.concatenate([u[:, None], multipliers[:, None]])
        given = np.concatenate([np.repeat(fixed[: len(u)], columns, 1), dense, np.repeat(fixed[len(u) :], columns, 1)])
        along = self.curvature(given)
        table: np.ndarray = dense[self.by_second].T @ along
        return (table + table.T) / 2


def whole_function(tape: Tape, name: str, value: object) -> Whole:
    """Return a function that was written on a tape whose inputs are all u."""
    top, count = as_entry(tape, value), len(tape.inputs)
    known = norm_terms(tape, top)
    groups = _groups(tape, top) if known is None else []
    parts = [part for group in groups for part in group] if known is None else known[1]
    nothing, entries = tape.constant(0.0), []
    for k, part in enumerate(parts):
        mine = [i for i in dependencies(tape, [part]) if tape.entries[i][0] is Op.INPUT]
        slopes = gradient(tape, part, mine)
        entries += [(k, tape.entries[i][1], slope) for i, slope in zip(mine, slopes, strict=True) if slope != nothing]
    directions = [tape.input().index for _ in range(count)]
    total = nothing
    for part in parts:
        total = tape.apply(Op.ADD, total, tape.apply(Op.MULTIPLY, tape.input().index, part))
    touched = sorted({j for _, j, _ in entries})
    slopes = gradient(tape, total, [tape.inputs[j] for j in touched])
    along = tangents(tape, slopes, {tape.inputs[j]: directions[j] for j in touched})
    curved = [(j, second) for j, second in zip(touched, along, strict=True) if second != nothing]
    table = np.array([(k, j) for k, j, _ in entries], dtype=np.int64).reshape(-1, 2)
    return Whole(
        name=name,
        groups=np.cumsum([0, *map(len, groups)], dtype=np.int64)[:-1] if groups else np.empty(0, dtype=np.int64),
        factor=1.0 if known is None else known[0],
        parts=len(parts),
        value=compile_evaluator(tape, parts),
        slope=compile_evaluator(tape, [slope for *_, slope in entries]),
        part=table[:, 0],
        by=table[:, 1],
        curvature=compile_evaluator(tape, [second for _, second in curved]),
        by_second=np.array([j for j, _ in curved], dtype=np.int64),
        inputs=count,
    )


def _groups(tape: Tape, top: int) -> list[list[int]]:
    """Return the pieces of every addend with kinks, after what is smooth as one."""
    smooth, groups = tape.constant(0.0), list[list[int]]()
    for term in summands(tape, top):
        found = smooth_pieces(tape, term)
        if len(found) > 1:
            groups.append(found)
        else:
            smooth = tape.apply(Op.ADD, smooth, term)
    return [[smooth], *groups]
