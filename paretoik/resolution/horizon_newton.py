"""The minimum of a small nonlinear program over the samples ahead, compiled; ``horizon`` says what of."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.resolution.matrices import decomposed, substituted

ITERATIONS = 60
CORRECTIONS = 12  # of Newton's method back onto the path
STATIONARY, ON_PATH = 1e-9, 1e-12  # share of the objective's slope; m or rad
ACCEPTED = 1e-10  # m or rad: rounding may keep from ON_PATH, but not from this
SHORTEST = 1e-7  # share of a step
LONGEST = 0.5  # rad or m: of one joint in one step
ENOUGH = 1e-4  # share of what a step promises
STIFFENED = 1e-3  # share of the largest curvature that is added first where one is negative


@compiled
def minimised(first, second, row, column, given, ahead, dof, rows):
    """Lead the positions, the first of ``given``, to a minimum; return (objective, whether it is one, iterations).

    ``given`` (inputs, 1) has positions, what is known, and multipliers after that. ``first`` gives the objective, its
    gradient, equations and their Jacobian, ``second`` the Hessian at ``row`` and ``column``. Every step is that of the
    quadratic model in the null space of the Jacobian, led back onto the path; where the model has no minimum it is made
    stiffer. Source: Nocedal & Wright, Numerical Optimization, algorithm 3.3 and section 16.2; Gabay 1982.
    """
    size, count, free = ahead * dof, ahead * rows, ahead * (dof - rows)
    prices = given.shape[0] - dof - count
    found = np.empty((1 + size + count + count * dof, 1))
    flat, asked = found.reshape(found.shape[0]), given.reshape(given.shape[0])
    bends, H = np.empty((row.shape[0], 1)), np.zeros((size, size))
    basis, step, before = np.zeros((size, free)), np.empty(size), np.empty(size)
    reduced, factor, pull, slope = np.empty((free, free)), np.empty((free, free)), np.empty(free), np.empty(free)
    factors, room = np.empty((ahead, rows, rows)), np.empty(rows)
    if not _onto_path(first, given, found, factors, room, ahead, dof, rows):
        return found[0, 0], False, 0
    for iteration in range(ITERATIONS):
        value, steep, left = found[0, 0], 0.0, 0.0
        gradient = flat[1 : 1 + size]
        J = flat[1 + size + count :].reshape((ahead, rows, dof))
        _priced(J, factors, gradient, asked[prices : prices + count], room)
        for k in range(ahead):
            _null_basis(
                J[k], factors[k], room, basis[k * dof : (k + 1) * dof, k * (dof - rows) : (k + 1) * (dof - rows)]
            )
        for j in range(size):
            steep = max(steep, abs(gradient[j]))
        for a in range(free):
            slope[a] = 0.0
            for j in range(size):
                slope[a] += basis[j, a] * gradient[j]
            left = max(left, abs(slope[a]))
            pull[a] = slope[a]
        if left <= STATIONARY * steep:
            return value, True, iteration
        run(second, given, bends)
        for e in range(row.shape[0]):
            H[row[e], column[e]] = H[column[e], row[e]] = bends[e, 0]
        _reduced(H, basis, reduced)
        if not _stiff(reduced, factor):
            return value, False, iteration
        substituted(factor, pull)
        longest, promised = 0.0, 0.0
        for a in range(free):
            promised += slope[a] * pull[a]
        for j in range(size):
            before[j], step[j] = given[j, 0], 0.0
            for a in range(free):
                step[j] -= basis[j, a] * pull[a]
            longest = max(longest, abs(step[j]))
        share = min(1.0, LONGEST / longest)
        while True:
            for j in range(size):
                given[j, 0] = before[j] + share * step[j]
            there = _onto_path(first, given, found, factors, room, ahead, dof, rows)
            if there and found[0, 0] <= value - ENOUGH * share * promised + 1e-14 * abs(value):
                break
            share *= 0.5
            if share < SHORTEST:  # rounding hides what is left
                for j in range(size):
                    given[j, 0] = before[j]
                return value, left <= 1e3 * STATIONARY * steep, iteration
    return found[0, 0], False, ITERATIONS


@compiled
def _onto_path(first, given, found, factors, room, ahead, dof, rows):
    """Lead positions onto the path by Newton's method, the shortest way; return whether they came there.

    What the program gives at the end is in ``found``, the factors of J Jᵀ of every sample in ``factors``.
    """
    size, count = ahead * dof, ahead * rows
    square, worst, flat = np.empty((rows, rows)), np.inf, found.reshape(found.shape[0])
    for correction in range(CORRECTIONS):
        run(first, given, found)
        gap, J = flat[1 + size : 1 + size + count], flat[1 + size + count :].reshape((ahead, rows, dof))
        off = 0.0
        for i in range(count):
            off = max(off, abs(gap[i]))
        for k in range(ahead):
            for i in range(rows):
                for m in range(rows):
                    square[i, m] = 0.0
                    for j in range(dof):
                        square[i, m] += J[k, i, j] * J[k, m, j]
            if not decomposed(square, factors[k]):
                return False
        if off <= ON_PATH or (off <= ACCEPTED and off >= 0.5 * worst):
            return True
        if not off < np.inf or (correction > 3 and off > worst):
            return False
        worst = off
        for k in range(ahead):
            for i in range(rows):
                room[i] = gap[k * rows + i]
            substituted(factors[k], room)
            for j in range(dof):
                move = 0.0
                for i in range(rows):
                    move -= J[k, i, j] * room[i]
                given[k * dof + j, 0] += min(max(move, -LONGEST), LONGEST)
    return False


@compiled
def _null_basis(J, factor, room, basis):
    """Write an orthonormal basis (dof, dof − rows) of the null space, by projected unit vectors, the longest first."""
    rows, dof = J.shape
    left = np.eye(dof)
    for j in range(dof):
        for i in range(rows):
            room[i] = J[i, j]
        substituted(factor, room)
        for k in range(dof):
            for i in range(rows):
                left[k, j] -= J[i, k] * room[i]
    for a in range(basis.shape[1]):
        best, most = 0, -1.0
        for j in range(dof):
            total = 0.0
            for k in range(dof):
                total += left[k, j] ** 2
            if total > most:
                best, most = j, total
        for k in range(dof):
            basis[k, a] = left[k, best] / np.sqrt(most)
        for j in range(dof):
            total = 0.0
            for k in range(dof):
                total += basis[k, a] * left[k, j]
            for k in range(dof):
                left[k, j] -= total * basis[k, a]


@compiled
def _priced(J, factors, slope, multipliers, room):
    """Write the multipliers that leave least of the slope."""
    ahead, rows, dof = J.shape
    for k in range(ahead):
        for i in range(rows):
            total = 0.0
            for j in range(dof):
                total -= J[k, i, j] * slope[k * dof + j]
            room[i] = total
        substituted(factors[k], room)
        for i in range(rows):
            multipliers[k * rows + i] = room[i]


@compiled
def _reduced(H, basis, reduced):
    """Write the curvature in the null space."""
    size, free = basis.shape
    for a in range(free):
        for b in range(a + 1):
            total = 0.0
            for j in range(size):
                if basis[j, a] != 0.0:
                    for k in range(size):
                        total += basis[j, a] * H[j, k] * basis[k, b]
            reduced[a, b] = reduced[b, a] = total


@compiled
def _stiff(reduced, factor):
    """Decompose a matrix, with as much added to its diagonal as that takes."""
    free = reduced.shape[0]
    largest = 0.0
    for a in range(free):
        largest = max(largest, abs(reduced[a, a]))
    added = 0.0
    for _ in range(60):
        if decomposed(reduced, factor):
            return True
        more = max(2.0 * added, STIFFENED * largest)
        for a in range(free):
            reduced[a, a] += more - added
        added = more
    return False
