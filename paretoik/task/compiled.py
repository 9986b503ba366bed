"""Newton's method back onto the path, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_block
from paretoik.compilation import compiled


@compiled
def newton(parts, targets, directions, limits, q, left, upright):
    """Lead postures q (samples, dof) onto the path along ``directions`` (samples, dof, rows), each on its own.

    ``parts`` is the program of errors and Jacobian entries at (q, targets); ``limits`` (tolerance, longest step,
    steps). Writes q, the largest error that was ``left`` when it was last looked at, and whether the Newton matrix was
    ``upright`` there: its determinant positive. A posture that has arrived makes room for the next.
    """
    code, constants, inputs, outputs, space = parts
    samples, n, rows = directions.shape
    tolerance, longest, steps = limits
    width, loaded = space.shape[1], inputs.shape[0]
    for j in range(constants.shape[0]):
        for lane in range(width):
            space[loaded + j, lane] = constants[j]
    who, taken = np.empty(width, dtype=np.int64), np.empty(width, dtype=np.int64)
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    begun = going = 0
    while True:
        while going < width and begun < samples:
            who[going], taken[going] = begun, 0
            begun += 1
            going += 1
        if going == 0:
            break
        for j in range(loaded):
            for lane in range(going):
                place = inputs[j]
                space[j, lane] = q[who[lane], place] if place < n else targets[who[lane], place - n]
        run_block(code, space, going)
        kept = 0
        for lane in range(going):
            s = who[lane]
            size = 0.0
            for i in range(rows):
                right[i] = space[outputs[i], lane]
                size = max(size, abs(right[i])) if right[i] == right[i] else np.nan
                for k in range(rows):
                    total = 0.0
                    for j in range(n):
                        total += space[outputs[rows + i * n + j], lane] * directions[s, j, k]
                    matrix[i, k] = total
            upright[s] = _eliminated(matrix, right) > 0
            left[s] = size
            taken[lane] += 1
            if not size > tolerance:
                continue
            for k in range(rows):
                move = min(max(right[k], -longest), longest) if right[k] == right[k] else 0.0
                for j in range(n):
                    q[s, j] += directions[s, j, k] * move
            if taken[lane] < steps:
                who[kept], taken[kept] = s, taken[lane]
                kept += 1
        going = kept


@compiled
def eliminate(matrices, right, determinants):
    """Overwrite matrices (count, size, size), and right (count, size) with what solves each; write determinants."""
    for i in range(len(matrices)):
        determinants[i] = _eliminated(matrices[i], right[i])


@compiled
def _eliminated(matrix, right):
    """Overwrite ``right`` with matrix⁻¹ right; return the determinant. By elimination without exchange of rows.

    Directions are ordered so that the matrix starts lower triangular with a positive diagonal; a pivot that vanishes
    gives inf or NaN.
    """
    size, determinant = len(right), 1.0
    for i in range(size):
        determinant *= matrix[i, i]
        for k in range(i + 1, size):
            factor = matrix[k, i] / matrix[i, i]
            for c in range(i + 1, size):
                matrix[k, c] -= factor * matrix[i, c]
            right[k] -= factor * right[i]
    for i in range(size - 1, -1, -1):
        for c in range(i + 1, size):
            right[i] -= matrix[i, c] * right[c]
        right[i] /= matrix[i, i]
    return determinant
