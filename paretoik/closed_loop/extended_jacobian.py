"""Genes to configurations, compiled: the steps that a population's extended Jacobians make (Marcos 2012, 4.1)."""

from __future__ import annotations

from paretoik.compilation import compiled


@compiled
def decode(genes, count, start, systems, q):
    """Write the joint positions (dof, batch) that ``count`` chromosomes (genes, batch) stand for: Eqs. 7, 12 and 13.

    A step that makes Δx is Δq = particular + N y, N the null space of the Jacobian. The rows J* Δq = Δx* of the
    extended Jacobian leave J* N y = Δx* − J* particular, a system of the size of the redundancy. ``systems`` holds the
    matrix and the right-hand side of each, entry by entry.
    """
    previous, particular, null_space = start.previous, start.particular, start.null_space
    n, r = null_space.shape
    for i in range(r):
        rhs, row = systems[r * r + i], i * (n + 1)
        _weighted_sum(genes, row, particular, n, count, rhs)
        target = genes[row + n]
        for k in range(count):
            rhs[k] = target[k] - rhs[k]
        for j in range(r):
            _weighted_sum(genes, row, null_space[:, j], n, count, systems[i * r + j])
    _solve(systems, r, count)
    for i in range(n):
        base, positions = previous[i] + particular[i], q[i]
        for j in range(r):
            y, factor = systems[r * r + j], null_space[i, j]
            if j == 0:
                for k in range(count):
                    positions[k] = base + factor * y[k]
            else:
                for k in range(count):
                    positions[k] += factor * y[k]


@compiled
def _weighted_sum(genes, row, weights, rows, count, result):
    """Write the weighted sum of ``rows`` rows of genes; rows are read before the loops, for vector instructions."""
    i = 0
    if rows >= 3:
        a, b, c = weights[0], weights[1], weights[2]
        row_a, row_b, row_c = genes[row], genes[row + 1], genes[row + 2]
        for k in range(count):
            result[k] = a * row_a[k] + b * row_b[k] + c * row_c[k]
        i = 3
    else:
        for k in range(count):
            result[k] = 0.0
    while i < rows:
        a, row_a = weights[i], genes[row + i]
        for k in range(count):
            result[k] += a * row_a[k]
        i += 1


@compiled
def _solve(systems, r, count):
    """Solve systems of r equations; the solutions overwrite the right-hand sides."""
    if r == 1:
        matrix, x = systems[0], systems[1]
        for k in range(count):
            x[k] /= matrix[k]
    elif r == 2:
        m11, m12, m21 = systems[0], systems[1], systems[2]
        m22, x, y = systems[3], systems[4], systems[5]
        for k in range(count):  # Cramer's rule
            a, b, c, d = m11[k], m12[k], m21[k], m22[k]
            e, f, determinant = x[k], y[k], a * d - b * c
            x[k], y[k] = (e * d - b * f) / determinant, (a * f - e * c) / determinant
    else:
        for k in range(count):
            _eliminate(systems, r, k)


@compiled
def _eliminate(systems, r, k):
    """Solve one system by Gaussian elimination with partial pivoting."""
    for column in range(r):
        pivot = column
        for i in range(column + 1, r):
            if abs(systems[i * r + column, k]) > abs(systems[pivot * r + column, k]):
                pivot = i
        for j in range(r):
            here, there = column * r + j, pivot * r + j
            systems[here, k], systems[there, k] = systems[there, k], systems[here, k]
        here, there = r * r + column, r * r + pivot
        systems[here, k], systems[there, k] = systems[there, k], systems[here, k]
        for i in range(column + 1, r):
            factor = systems[i * r + column, k] / systems[column * r + column, k]
            for j in range(column, r):
                systems[i * r + j, k] -= factor * systems[column * r + j, k]
            systems[r * r + i, k] -= factor * systems[r * r + column, k]
    for i in range(r - 1, -1, -1):
        for j in range(i + 1, r):
            systems[r * r + i, k] -= systems[i * r + j, k] * systems[r * r + j, k]
        systems[r * r + i, k] /= systems[i * r + i, k]
