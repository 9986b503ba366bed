"""Small dense programs as arrays, for compiled solvers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.errors import EvaluationFailed
from paretoik.nlp.dense import dense_kernel as _steps  # noqa: F401  the steps of solvers on these arrays
from paretoik.nlp.dense.dense_rows import DenseKernel
from paretoik.nlp.dense.traced_rows import AssembledRows, Part


def dense_kernel(program: AssembledRows, costs: Float[np.ndarray, "objectives unknowns"]) -> DenseKernel:
    """Return rows and linear objectives for compiled code; raise EvaluationFailed for too few unknowns."""
    kernel = _kernel(program)
    if kernel.equalities > kernel.unknowns:
        raise EvaluationFailed(f"program must have at least {kernel.equalities} unknowns, got {kernel.unknowns}")
    return kernel._replace(objectives=np.ascontiguousarray(costs, dtype=float))


@lru_cache(maxsize=64)
def _kernel(whole: AssembledRows) -> DenseKernel:
    unknowns, parts = whole.unknowns, whole.parts
    equalities = sum(part.program.equalities * len(part.where) for part in parts)
    inequalities = sum(part.program.inequalities * len(part.where) for part in parts)
    first_h, first_c = 0, equalities
    tables, rows, first, second = [], [], [], []
    begin = np.zeros(3, dtype=np.int64)
    for part in parts:
        program, places = part.program, len(part.where)
        lane = np.arange(places)
        row = np.concatenate(
            [
                first_h + np.arange(program.equalities)[:, None] + program.equalities * lane,
                first_c + np.arange(program.inequalities)[:, None] + program.inequalities * lane,
            ]
        )
        first_h, first_c = first_h + program.equalities * places, first_c + program.inequalities * places
        counts = [places, part.where.shape[1], part.parameters.shape[1], len(row)]
        tables.append([*counts, program.equalities > 0, *begin])
        begin += part.where.size, part.parameters.size, row.size
        rows.append(row.ravel())
        (i, j), (a, b) = program.jacobian_pattern, program.hessian_pattern
        first.append((row[i].ravel(), part.where.T[j].ravel()))
        second.append((part.where.T[a].ravel(), part.where.T[b].ravel()))
    first_row, first_column = np.concatenate(first, axis=1).astype(np.int64)
    second_row, second_column = np.concatenate(second, axis=1).astype(np.int64)
    order = np.lexsort((first_column, first_row))
    by_row = order[first_row[order] >= equalities]
    return DenseKernel(
        unknowns=unknowns,
        equalities=equalities,
        inequalities=inequalities,
        objectives=np.zeros((0, unknowns)),
        **_concatenate_evaluators(parts),
        parts=np.array(tables, dtype=np.int64),
        where=np.concatenate([part.where.T.ravel() for part in parts]).astype(np.int64),
        parameters=np.concatenate([part.parameters.T.ravel() for part in parts]),
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


def _concatenate_evaluators(parts: Sequence[Part]) -> dict[str, Any]:
    """Return the joined arrays of all evaluators and a table of where each one begins and ends."""
    arrays: list[list[np.ndarray]] = [[], [], [], []]
    ends, programs = np.zeros(4, dtype=np.int64), []
    for part in parts:
        table = []
        for evaluator in (part.program.values, part.program.jacobian_entries, part.program.hessian_entries):
            each = (evaluator.code, evaluator.constants, evaluator.inputs, evaluator.outputs)
            sizes = np.array([len(array) for array in each])
            table.append([*np.stack([ends, ends + sizes], axis=1).ravel(), evaluator.registers, len(evaluator.outputs)])
            ends = ends + sizes
            for collected, array in zip(arrays, each, strict=True):
                collected.append(array)
        programs.append(table)
    names = ("code", "constants", "inputs", "outputs")
    joined = {name: np.concatenate(collected) for name, collected in zip(names, arrays, strict=True)}
    return joined | {"programs": np.array(programs, dtype=np.int64)}
