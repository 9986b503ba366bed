"""Genes to configurations, compiled: the steps that a population's extended Jacobians make (Marcos 2012, 4.1)."""

from __future__ import annotations

from paretoik.compilation import compiled


@compiled
def decode(genes, first, last, start, systems, q):
    """Write the joint positions (dof, batch) that genes (genes, batch) stand for: Eqs. 7, 12 and 13.

    A step that makes Δx is Δq = particular + N y, N the null space of the Jacobian. The rows J* Δq = Δx* of the
    extended Jacobian leave J* N y = Δx* − J* particular, a system of the size of the redundancy. ``systems`` holds the
    matrix and the right-hand side of each, entry by entry.
    """
    previous, particular, null_space = start.previous, start.particular, start.null_space
    n, r = null_space.shape
    count = last - first  # loops begin at 0: an index needs no check for negative numbers
    for i in range(r):
        rhs, row = systems[r * r + i, first:last], i * (n + 1)
        _weighted_sum(genes, row, particular, n, first, last, rhs)
        target = genes[row + n, first:last]
        for k in range(count):
            rhs[k] = target[k] - rhs[k]
        for j in range(r):
            _weighted_sum(genes, row, null_space[:, j], n, first, last, systems[i * r + j, first:last])
    _solve(systems, r, first, last)
    for i in range(n):
        base, positions = previous[i] + particular[i], q[i, first:last]
        for j in range(r):
            y, factor = systems[r * r + j, first:last], null_space[i, j]
            if j == 0:
                for k in range(count):
                    positions[k] = base + factor * y[k]
            else:
                for k in range(count):
                    positions[k] += factor * y[k]


@compiled
def _weighted_sum(genes, row, weights, rows, first, last, result):
    """Write the weighted sum of ``rows`` rows of genes; rows are read before the loops, for vector instructions."""
    i, count = 0, last - first
    if rows >= 3:
        a, b, c = weights[0], weights[1], weights[2]
        row_a, row_b, row_c = genes[row, first:last], genes[row + 1, first:last], genes[row + 2, first:last]
        for k in range(count):
            result[k] = a * row_a[k] + b * row_b[k] + c * row_c[k]
        i = 3
    else:
        for k in range(count):
            result[k] = 0.0
    while i < rows:
        a, row_a = weights[i], genes[row + i, first:last]
        for k in range(count):
            result[k] += a * row_a[k]
        i += 1


@compiled
def _solve(systems, r, first, last):
    """Solve systems of r equations; the solutions overwrite the right-hand sides."""
    if r == 1:
        matrix, x = systems[0, first:last], systems[1, first:last]
        for k in range(last - first):
            x[k] /= matrix[k]
    elif r == 2:
        m11, m12, m21 = systems[0, first:last], systems[1, first:last], systems[2, first:last]
        m22, x, y = systems[3, first:last], systems[4, first:last], systems[5, first:last]
        for k in range(last - first):  # Cramer's rule
            a, b, c, d = m11[k], m12[k], m21[k], m22[k]
            e, f, determinant = x[k], y[k], a * d - b * c
            x[k], y[k] = (e * d - b * f) / determinant, (a * f - e * c) / determinant
    else:
        for k in range(first, last):
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
