"""Small dense programs as arrays, for compiled solvers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.errors import EvaluationFailed
from paretoik.nlp.assembled import Assembled, Part
from paretoik.nlp.compiled.dense_kernel import DenseKernel
from paretoik.nlp.traced import Rows, Smooth


def dense_kernel(program: Rows, costs: Float[np.ndarray, "objectives unknowns"]) -> DenseKernel:
    """Return rows and linear objectives as compiled code takes them; raise EvaluationFailed for too few unknowns."""
    assert isinstance(program, Assembled | Smooth)
    kernel = _kernel(program, costs.shape[1])
    if kernel.equalities > kernel.unknowns:
        raise EvaluationFailed(f"program: at least {kernel.equalities} unknowns wanted, got {kernel.unknowns}")
    return kernel._replace(objectives=np.ascontiguousarray(costs, dtype=float))


@lru_cache(maxsize=64)
def _kernel(program: Assembled | Smooth, unknowns: int) -> DenseKernel:
    if isinstance(program, Assembled):
        return _kernel_of_parts(unknowns, program.parts)
    whole = Part(program=program, where=np.arange(unknowns)[None], parameters=program.parameters[None])
    return _kernel_of_parts(unknowns, [whole])


def _kernel_of_parts(unknowns: int, parts: Sequence[Part]) -> DenseKernel:
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
        objectives=np.zeros((0, unknowns)),
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
