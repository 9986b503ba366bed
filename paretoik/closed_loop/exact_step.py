"""The best step of an extended Jacobian, found exactly: compiled, for planar arms of one or two redundant degrees.

Steps that reach the target to first order are p + N y, N orthonormal and orthogonal to p. The displacement of Marcos
et al. 2012, Eq. 17, is then a constant plus 2 ‖y − y₁‖² / Δt²: what is left is a search over the radius ρ about y₁ and,
with two redundant degrees, the angle θ around it. All geometry here is its own.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled, inlined
from paretoik.nlp.compiled.scalar_search import golden_section

NEAREST, FINE, FARTHEST = 1e-7, 0.1, 8.0  # of the radii [rad]: evenly in their logarithm up to FINE, then evenly
RADII = (40, 80), (24, 40)  # for one redundant degree, and for two
ANGLES = 24
ERROR, RADIUS, SUM = range(3)  # what is least
KEPT = 3, 6  # cells of the grid that are searched further
HALVINGS, TURNS = 36, 150
SMALL = 1e-9  # of the radius: a simplex that has ended
NEWTON, EXACT = 12, 1e-13  # iterations, and what counts as no error [m]


@compiled
def error(lengths, q, target):
    """Return the distance of the tip from a target."""
    x, y, angle = 0.0, 0.0, 0.0
    for k in range(lengths.shape[0]):
        angle += q[k]
        x += lengths[k] * np.cos(angle)
        y += lengths[k] * np.sin(angle)
    return np.hypot(x - target[0], y - target[1])


@compiled
def hits(lengths, q, circles, boxes):
    """Return whether a link meets a circle (x, y, radius) or a box (left, bottom, right, top)."""
    x, y, angle = 0.0, 0.0, 0.0
    for k in range(lengths.shape[0]):
        angle += q[k]
        u, v = x + lengths[k] * np.cos(angle), y + lengths[k] * np.sin(angle)
        for i in range(circles.shape[0]):
            dx, dy = u - x, v - y
            along = ((circles[i, 0] - x) * dx + (circles[i, 1] - y) * dy) / (dx * dx + dy * dy)
            along = min(max(along, 0.0), 1.0)
            if np.hypot(x + along * dx - circles[i, 0], y + along * dy - circles[i, 1]) <= circles[i, 2]:
                return True
        for i in range(boxes.shape[0]):
            if _crosses(x, y, u, v, boxes[i]):
                return True
        x, y = u, v
    return False


@compiled
def _crosses(x, y, u, v, box):
    """Return whether a segment meets a box: the stretches within its two slabs overlap (Liang & Barsky 1984)."""
    first, last = 0.0, 1.0
    for axis in range(2):
        start, step = (x, u - x) if axis == 0 else (y, v - y)
        low, high = box[axis] - start, box[axis + 2] - start
        if step == 0.0:
            if low > 0.0 or high < 0.0:
                return False
            continue
        one, other = low / step, high / step
        first, last = max(first, min(one, other)), min(last, max(one, other))
    return first <= last


@compiled
def _missed(rho, theta, scene, q):
    """Write the joint positions of a step; return its error, inf where it is blocked."""
    lengths, base, null, best, target, circles, boxes = scene
    for k in range(lengths.shape[0]):
        q[k] = base[k]
    if null.shape[1] == 1:  # one way or the other
        ahead, aside = (rho if theta < 1.0 else -rho), 0.0
    else:
        ahead, aside = rho * np.cos(theta), rho * np.sin(theta)
    for j in range(null.shape[1]):
        y = best[j] + (ahead if j == 0 else aside)
        for k in range(lengths.shape[0]):
            q[k] += null[k, j] * y
    if circles.shape[0] + boxes.shape[0] > 0 and hits(lengths, q, circles, boxes):
        return np.inf
    return error(lengths, q, target)


@compiled
def _worth(rho, missed, what, ranges):
    """Return what a step is worth: its error, its radius, or the weighted sum of both objectives; inf where blocked."""
    if what == ERROR or not missed < np.inf:
        return missed
    if what == RADIUS:
        return rho
    weight, reach, least, width = ranges
    return weight * (rho / reach) ** 2 + (1.0 - weight) * (missed - least) / width


@inlined
def _worth_at(rho, arguments):
    theta, what, ranges, scene, q = arguments
    return _worth(rho, _missed(rho, theta, scene, q), what, ranges)


@compiled
def _along(low, high, theta, what, ranges, scene, q):
    """Return (worth, ρ) of the least between two radii, by golden sections; from blocked ones towards the middle."""
    return golden_section(_worth_at, (theta, what, ranges, scene, q), low, high, HALVINGS, 0.5 * (low + high))


@compiled
def _around(rho, theta, size, what, ranges, scene, q, simplex):
    """Return (worth, ρ, θ) of the least that a simplex about a place leads to (Nelder & Mead 1965)."""
    for i in range(3):
        simplex[i, 0] = rho * np.cos(theta) + (size if i == 1 else 0.0)
        simplex[i, 1] = rho * np.sin(theta) + (size if i == 2 else 0.0)
        simplex[i, 2] = _at(simplex[i, 0], simplex[i, 1], what, ranges, scene, q)
    for _ in range(TURNS):
        for i in range(2):  # the best first, the worst last
            for k in range(2 - i):
                if simplex[k, 2] > simplex[k + 1, 2]:
                    for m in range(3):
                        simplex[k, m], simplex[k + 1, m] = simplex[k + 1, m], simplex[k, m]
        across = max(abs(simplex[2, 0] - simplex[0, 0]), abs(simplex[2, 1] - simplex[0, 1]))
        if across < SMALL * rho:
            break
        u, v = 0.5 * (simplex[0, 0] + simplex[1, 0]), 0.5 * (simplex[0, 1] + simplex[1, 1])
        du, dv = u - simplex[2, 0], v - simplex[2, 1]
        step, worth = 1.0, _at(u + du, v + dv, what, ranges, scene, q)
        if worth < simplex[0, 2]:
            further = _at(u + 2.0 * du, v + 2.0 * dv, what, ranges, scene, q)
            if further < worth:
                step, worth = 2.0, further
        elif worth >= simplex[1, 2]:
            step = 0.5 if worth < simplex[2, 2] else -0.5
            worth = _at(u + step * du, v + step * dv, what, ranges, scene, q)
        if worth < simplex[2, 2]:
            simplex[2, 0], simplex[2, 1], simplex[2, 2] = u + step * du, v + step * dv, worth
            continue
        for i in range(1, 3):
            for m in range(2):
                simplex[i, m] = 0.5 * (simplex[i, m] + simplex[0, m])
            simplex[i, 2] = _at(simplex[i, 0], simplex[i, 1], what, ranges, scene, q)
    best = 0
    for i in range(1, 3):
        best = i if simplex[i, 2] < simplex[best, 2] else best
    return (
        simplex[best, 2],
        np.hypot(simplex[best, 0], simplex[best, 1]),
        np.arctan2(simplex[best, 1], simplex[best, 0]),
    )


@compiled
def _at(u, v, what, ranges, scene, q):
    rho = np.hypot(u, v)
    return _worth(rho, _missed(rho, np.arctan2(v, u), scene, q), what, ranges)


@compiled
def _least(what, ranges, scene, q, errors, table, radii, angles):
    """Return (worth, ρ, θ) of the least: the best cells of a grid, searched further by golden sections."""
    rows, columns = radii.shape[0], angles.shape[0]
    for i in range(rows):
        for j in range(columns):
            table[i, j] = _worth(radii[i], errors[i, j], what, ranges)
    best, rho, theta = table[0, 0], 0.0, 0.0
    simplex = np.zeros((3, 3))
    for _ in range(KEPT[0] if columns == 2 else KEPT[1]):
        at, across, least = -1, -1, np.inf
        for i in range(rows):
            for j in range(columns):
                if table[i, j] < least and _is_lowest(table, i, j):
                    at, across, least = i, j, table[i, j]
        if at < 0:
            break
        low, high, angle = radii[max(at - 1, 0)], radii[min(at + 1, rows - 1)], angles[across]
        table[at, across] = np.inf
        if scene[2].shape[1] == 1:
            found, place = _along(low, high, angle, what, ranges, scene, q)
        else:
            size = 0.5 * (high - low)
            found, place, angle = _around(radii[at], angle, size, what, ranges, scene, q, simplex)
        if least < min(best, found):
            best, rho, theta = least, radii[at], angles[across]
        elif found < best:
            best, rho, theta = found, place, angle
    return best, rho, theta


@compiled
def _hit_targets(scene, q, errors, table, radii, angles):
    """Return (ρ, θ) of the nearest free step of two redundant degrees that hits the target; ρ is inf without one.

    From every lowest cell of the grid by Newton's method.
    """
    lengths, base, null, best, target, _, _ = scene
    n, nearest, around = lengths.shape[0], np.inf, 0.0
    table[:] = errors
    for i in range(1, radii.shape[0]):
        for j in range(angles.shape[0]):
            if not errors[i, j] < np.inf or not _is_lowest(table, i, j):
                continue
            u, v = radii[i] * np.cos(angles[j]), radii[i] * np.sin(angles[j])
            missed = np.inf
            for _ in range(NEWTON):
                x, y, angle = -target[0], -target[1], 0.0
                a, b, c, d, turned, other = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(n):
                    angle += base[k] + null[k, 0] * (best[0] + u) + null[k, 1] * (best[1] + v)
                    turned, other = turned + null[k, 0], other + null[k, 1]
                    dx, dy = lengths[k] * np.cos(angle), lengths[k] * np.sin(angle)
                    x, y = x + dx, y + dy
                    a, b, c, d = a - dy * turned, b - dy * other, c + dx * turned, d + dx * other
                missed, size = np.hypot(x, y), a * d - b * c
                if missed < EXACT or not abs(size) > EXACT:
                    break
                u, v = u - (d * x - b * y) / size, v - (a * y - c * x) / size
            rho, theta = np.hypot(u, v), np.arctan2(v, u)
            if missed < EXACT and rho < min(nearest, FARTHEST) and _missed(rho, theta, scene, q) < np.inf:
                nearest, around = rho, theta
    return nearest, around


@compiled
def _is_lowest(table, i, j):
    """Return whether no neighbour of a cell is lower, angles being around."""
    rows, columns = table.shape
    for k in (-1, 1):
        if 0 <= i + k < rows and table[i + k, j] < table[i, j]:
            return False
        if columns > 2 and table[i, (j + k) % columns] < table[i, j]:
            return False
    return True


@compiled
def best_step(lengths, previous, home, target, weight, circles, boxes, q):
    """Write the best step's joint positions to ``q``; return whether there is one that is free."""
    n = lengths.shape[0]
    jacobian, tip = np.zeros((2, n)), np.zeros((n + 1, 2))
    angle = 0.0
    for k in range(n):
        angle += previous[k]
        tip[k + 1, 0] = tip[k, 0] + lengths[k] * np.cos(angle)
        tip[k + 1, 1] = tip[k, 1] + lengths[k] * np.sin(angle)
    for k in range(n):
        jacobian[0, k], jacobian[1, k] = -(tip[n, 1] - tip[k, 1]), tip[n, 0] - tip[k, 0]
    full = np.linalg.svd(jacobian)
    right, sizes, left = full[2], full[1], full[0]
    wanted = np.array([target[0] - tip[n, 0], target[1] - tip[n, 1]])
    base = previous.copy()
    for i in range(2):
        amount = (left[0, i] * wanted[0] + left[1, i] * wanted[1]) / sizes[i]
        for k in range(n):
            base[k] += right[i, k] * amount
    null = np.ascontiguousarray(right[2:].T)
    best = np.zeros(n - 2)
    for j in range(n - 2):
        for k in range(n):
            best[j] -= 0.5 * null[k, j] * (base[k] - home[k])
    scene = (lengths, base, null, best, target, circles, boxes)
    if weight >= 1.0 and _missed(0.0, 0.0, scene, q) < np.inf:
        return True
    fine, coarse = RADII[0] if n == 3 else RADII[1]
    rows, columns = 1 + fine + coarse, 2 if n == 3 else ANGLES
    radii, angles = np.zeros(rows), np.zeros(columns)
    errors, table = np.zeros((rows, columns)), np.zeros((rows, columns))
    for i in range(fine):
        radii[i + 1] = NEAREST * (FINE / NEAREST) ** (i / (fine - 1))
    for i in range(coarse):
        radii[i + 1 + fine] = FINE + (FARTHEST - FINE) * (i + 1) / coarse
    for j in range(columns):
        angles[j] = 2.0 * np.pi * j / columns
    for i in range(rows):
        for j in range(columns):
            errors[i, j] = _missed(radii[i], angles[j], scene, q)
    none = (0.0, 1.0, 0.0, 1.0)
    nearest, rho, theta = 0.0, 0.0, 0.0
    if not errors[0, 0] < np.inf:
        nearest, rho, theta = _least(RADIUS, none, scene, q, errors, table, radii, angles)
    if not nearest < np.inf:
        return False
    most = _missed(rho, theta, scene, q)
    if weight < 1.0:
        least, far, around = 0.0, np.inf, 0.0
        if n == 4:
            far, around = _hit_targets(scene, q, errors, table, radii, angles)
        if not far < np.inf:
            least, far, around = _least(ERROR, none, scene, q, errors, table, radii, angles)
        if weight <= 0.0:
            rho, theta = far, around
        elif far > rho and most > least:
            ranges = (weight, np.sqrt(far**2 - rho**2), least, most - least)
            _, rho, theta = _least(SUM, ranges, scene, q, errors, table, radii, angles)
    _missed(rho, theta, scene, q)
    return True
