"""From programs of parts to the arrays of ``DenseKernel``, and how these are minimised."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import lru_cache
from typing import cast

import numpy as np
from jaxtyping import Float

from paretoik.errors import EvaluationFailed
from paretoik.nlp.assembled import Assembled, Part
from paretoik.nlp.compiled.dense_kernel import DenseKernel
from paretoik.nlp.compiled.interior_point import minimise
from paretoik.nlp.dense_sqp import Caps, Minimum
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.solutions import CONVERGED, NOT_FINITE
from paretoik.nlp.traced import Rows, Smooth

OPTIONS = InteriorPointOptions(
    barrier=1e-2,
    last_barrier=1e-12,
    penalty=100.0,
    iterations=300,
    longest_step=np.inf,
    implied_slacks=False,
    large_multiplier=100.0,
)


def minimise_dense(
    program: Rows,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    *,
    caps: Caps | None = None,
    options: InteriorPointOptions = OPTIONS,
) -> Minimum:
    """Return a local minimum of cost · z below caps, from any point.

    Raises EvaluationFailed where the program is not finite at the point, or has more equalities than unknowns.
    """
    size = float(np.linalg.norm(cost)) or 1.0
    rows, upper = (np.zeros((0, len(z))), np.zeros(0)) if caps is None else (caps.rows, caps.most)
    kernel = _kernel(cast(Hashable, program), len(z))._replace(objectives=np.concatenate([cost[None] / size, rows]))
    if kernel.equalities > len(z):
        raise EvaluationFailed(f"program: at least {kernel.equalities} unknowns wanted, got {len(z)}")
    count = len(kernel.objectives)
    x, status, iterations, _, multipliers, _, _ = minimise(
        kernel, np.array(z, dtype=float), np.eye(count)[0], np.eye(count), np.append(np.inf, upper), options
    )
    if status == NOT_FINITE:
        raise EvaluationFailed("program: finite rows and slopes wanted, got others")
    equalities, inequalities = program.rows(x)
    violations = np.concatenate([np.abs(equalities), -inequalities, rows @ x - upper])
    return Minimum(
        z=x,
        limits=size * multipliers,
        violation=float(violations.max(initial=0.0)),
        converged=status == CONVERGED,
        iterations=iterations,
    )


@lru_cache(maxsize=64)
def _kernel(program: Hashable, unknowns: int) -> DenseKernel:
    if isinstance(program, Assembled):
        return dense_kernel(unknowns, program.parts, np.zeros((0, unknowns)))
    assert isinstance(program, Smooth)
    whole = Part(program=program, where=np.arange(unknowns)[None], parameters=program.parameters[None])
    return dense_kernel(unknowns, [whole], np.zeros((0, unknowns)))


def dense_kernel(
    unknowns: int, parts: Sequence[Part], objectives: Float[np.ndarray, "objectives unknowns"]
) -> DenseKernel:
    """Return a program of parts as compiled code takes it, its objectives linear."""
    equalities = sum(part.program.equalities * len(part.where) for part in parts)
    inequalities = sum(part.program.inequalities * len(part.where) for part in parts)
    first_h, first_c = 0, equalities
    tables, programs, rows, first, second = [], [], [], [], []
    arrays: list[list[np.ndarray]] = [[], [], [], []]
    ends = np.zeros(4, dtype=np.int64)
    where, parameters = [], []
    begin = np.zeros(3, dtype=np.int64)
    for part in parts:
        own, places = part.program, len(part.where)
        lane = np.arange(places)
        row = np.concatenate(
            [
                first_h + np.arange(own.equalities)[:, None] + own.equalities * lane,
                first_c + np.arange(own.inequalities)[:, None] + own.inequalities * lane,
            ]
        )
        first_h, first_c = first_h + own.equalities * places, first_c + own.inequalities * places
        tables.append([places, part.where.shape[1], part.parameters.shape[1], len(row), own.equalities > 0, *begin])
        begin += part.where.size, part.parameters.size, row.size
        table = []
        for one in (own.values, own.first, own.second):
            each = (one.code, one.constants, one.inputs, one.outputs)
            sizes = np.array([len(array) for array in each])
            table.append([*np.stack([ends, ends + sizes], axis=1).ravel(), one.registers, len(one.outputs)])
            ends = ends + sizes
            for known, array in zip(arrays, each, strict=True):
                known.append(array)
        programs.append(table)
        rows.append(row.ravel())
        where.append(part.where.T.ravel())
        parameters.append(part.parameters.T.ravel())
        (i, j), (a, b) = own.places, own.bends
        first.append((row[i].ravel(), part.where.T[j].ravel()))
        second.append((part.where.T[a].ravel(), part.where.T[b].ravel()))
    first_row, first_column = (np.concatenate([pair[k] for pair in first]).astype(np.int64) for k in (0, 1))
    second_row, second_column = (np.concatenate([pair[k] for pair in second]).astype(np.int64) for k in (0, 1))
    order = np.lexsort((first_column, first_row))
    by_row = order[first_row[order] >= equalities]
    return DenseKernel(
        unknowns=unknowns,
        equalities=equalities,
        inequalities=inequalities,
        objectives=np.ascontiguousarray(objectives, dtype=float),
        code=np.concatenate(arrays[0]),
        constants=np.concatenate(arrays[1]),
        inputs=np.concatenate(arrays[2]),
        outputs=np.concatenate(arrays[3]),
        programs=np.array(programs, dtype=np.int64),
        parts=np.array(tables, dtype=np.int64),
        where=np.concatenate(where).astype(np.int64),
        parameters=np.concatenate(parameters),
        row=np.concatenate(rows).astype(np.int64),
        begin_first=np.cumsum([0, *(len(pair[0]) for pair in first)]),
        first_row=first_row,
        first_column=first_column,
        begin_second=np.cumsum([0, *(len(pair[0]) for pair in second)]),
        second_row=second_row,
        second_column=second_column,
        by_row=by_row,
        begin_row=np.searchsorted(first_row[by_row], equalities + np.arange(inequalities + 1)),
    )
