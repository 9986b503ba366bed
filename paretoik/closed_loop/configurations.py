"""Where genes lead, compiled: the steps of a population's extended Jacobians."""

from __future__ import annotations

from paretoik.compilation import compiled


@compiled
def configurations(genes, first, last, place, work, q):
    """Write the joint positions (dof, lanes) that genes (genes, lanes) stand for: Eqs. 7, 12 and 13.

    A step Δq that makes Δx is the shortest one plus null · y, of which the rows J* Δq = Δx* leave J* null y = Δx* − J*
    particular.
    """
    previous, particular, null = place.previous, place.particular, place.null
    n, r = null.shape
    for i in range(r):
        right, begun = work[r * r + i], i * (n + 1)
        _weighed(genes, begun, particular, n, first, last, right)
        last_gene = genes[begun + n]
        for lane in range(first, last):
            right[lane] = last_gene[lane] - right[lane]
        for j in range(r):
            _weighed(genes, begun, null[:, j], n, first, last, work[i * r + j])
    _solve(work, r, first, last)
    for k in range(n):
        start, to = previous[k] + particular[k], q[k]
        for j in range(r):
            y, factor = work[r * r + j], null[k, j]
            if j == 0:
                for lane in range(first, last):
                    to[lane] = start + factor * y[lane]
            else:
                for lane in range(first, last):
                    to[lane] += factor * y[lane]


@compiled
def _weighed(genes, begun, factors, count, first, last, found):
    """Write the weighted sum of ``count`` rows of genes; what is read before a loop lets it run on many lanes."""
    k = 0
    if count >= 3:
        a, b, c = factors[0], factors[1], factors[2]
        one, two, three = genes[begun], genes[begun + 1], genes[begun + 2]
        for lane in range(first, last):
            found[lane] = a * one[lane] + b * two[lane] + c * three[lane]
        k = 3
    else:
        for lane in range(first, last):
            found[lane] = 0.0
    while k < count:
        a, one = factors[k], genes[begun + k]
        for lane in range(first, last):
            found[lane] += a * one[lane]
        k += 1


@compiled
def _solve(work, r, first, last):
    """Solve r equations a lane, table and right sides in rows of ``work``; the solutions replace the right sides."""
    if r == 1:
        for lane in range(first, last):
            work[1, lane] /= work[0, lane]
        return
    if r == 2:
        w0, w1, w2, w3, w4, w5 = work[0], work[1], work[2], work[3], work[4], work[5]
        for lane in range(first, last):
            a, b, c, d = w0[lane], w1[lane], w2[lane], w3[lane]
            e, f, size = w4[lane], w5[lane], a * d - b * c
            w4[lane], w5[lane] = (e * d - b * f) / size, (a * f - e * c) / size
        return
    for lane in range(first, last):
        for column in range(r):
            pivot = column
            for i in range(column + 1, r):
                if abs(work[i * r + column, lane]) > abs(work[pivot * r + column, lane]):
                    pivot = i
            for j in range(r):
                one, other = column * r + j, pivot * r + j
                work[one, lane], work[other, lane] = work[other, lane], work[one, lane]
            one, other = r * r + column, r * r + pivot
            work[one, lane], work[other, lane] = work[other, lane], work[one, lane]
            for i in range(column + 1, r):
                factor = work[i * r + column, lane] / work[column * r + column, lane]
                for j in range(column, r):
                    work[i * r + j, lane] -= factor * work[column * r + j, lane]
                work[r * r + i, lane] -= factor * work[r * r + column, lane]
        for i in range(r - 1, -1, -1):
            for j in range(i + 1, r):
                work[r * r + i, lane] -= work[i * r + j, lane] * work[r * r + j, lane]
            work[r * r + i, lane] /= work[i * r + i, lane]
