"""The best step of an extended Jacobian, found exactly: compiled, for planar arms of one or two redundant degrees.

Steps that reach the target to first order are p + N y, N orthonormal and orthogonal to p. The displacement of Marcos
et al. 2012, Eq. 17, is then a constant plus 2 ‖y − y₁‖² / Δt²: what is left is a search over the radius ρ about y₁ and,
with two redundant degrees, the angle θ around it. All geometry here is its own.
"""

from __future__ import annotations

import numpy as np

from paretoik.calculus.compiling import compiled

NEAREST, FARTHEST = 1e-7, 8.0  # of the radii [rad]
RADII, ANGLES = 160, 48
KEPT = 4  # cells of the grid that are searched further
GOLDEN = 0.6180339887498949
HALVINGS, TURNS = 60, 40


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
def _worth(rho, theta, what, ranges, scene, q):
    """Return what a step is worth: its error, or the weighted sum of both objectives; inf where it is blocked."""
    lengths, base, null, best, target, circles, boxes = scene
    r = null.shape[1]
    for k in range(lengths.shape[0]):
        q[k] = base[k]
    for j in range(r):
        turned = np.cos(theta) if j == 0 else np.sin(theta)
        for k in range(lengths.shape[0]):
            q[k] += null[k, j] * (best[j] + rho * turned)
    if circles.shape[0] + boxes.shape[0] > 0 and hits(lengths, q, circles, boxes):
        return np.inf
    missed = error(lengths, q, target)
    if what == 0:
        return missed
    if what == 1:
        return rho
    weight, reach, least, width = ranges
    return weight * (rho / reach) ** 2 + (1.0 - weight) * (missed - least) / width


@compiled
def _along_angle(rho, theta, spread, what, ranges, scene, q):
    """Return the least worth at a radius, near an angle, and where it is."""
    if scene[2].shape[1] == 1:
        return _worth(rho, theta, what, ranges, scene, q), theta
    low, high = theta - spread, theta + spread
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = _worth(rho, a, what, ranges, scene, q), _worth(rho, b, what, ranges, scene, q)
    for _ in range(TURNS):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = _worth(rho, a, what, ranges, scene, q)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = _worth(rho, b, what, ranges, scene, q)
    return (at_a, a) if at_a <= at_b else (at_b, b)


@compiled
def _least(what, ranges, scene, q, table, radii, angles):
    """Return (worth, ρ, θ) of the least: the best cells of a grid, searched further by golden sections."""
    rows, columns = radii.shape[0], angles.shape[0]
    for i in range(rows):
        for j in range(columns):
            table[i, j] = _worth(radii[i], angles[j], what, ranges, scene, q)
    best, rho, theta = table[0, 0], 0.0, 0.0
    spread = 2.0 * np.pi / columns
    for _ in range(KEPT):
        at, across, least = -1, -1, np.inf
        for i in range(rows):
            for j in range(columns):
                if table[i, j] < least and _is_lowest(table, i, j):
                    at, across, least = i, j, table[i, j]
        if at < 0:
            break
        if least < best:
            best, rho, theta = least, radii[at], angles[across]
        low, high = radii[max(at - 1, 0)], radii[min(at + 1, rows - 1)]
        table[at, across] = np.inf
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_a, angle_a = _along_angle(a, angles[across], spread, what, ranges, scene, q)
        at_b, angle_b = _along_angle(b, angles[across], spread, what, ranges, scene, q)
        for _ in range(HALVINGS):
            if at_a <= at_b:
                high, b, at_b, angle_b = b, a, at_a, angle_a
                a = high - GOLDEN * (high - low)
                at_a, angle_a = _along_angle(a, angle_b, spread, what, ranges, scene, q)
            else:
                low, a, at_a, angle_a = a, b, at_b, angle_b
                b = low + GOLDEN * (high - low)
                at_b, angle_b = _along_angle(b, angle_a, spread, what, ranges, scene, q)
        if at_a < best:
            best, rho, theta = at_a, a, angle_a
        if at_b < best:
            best, rho, theta = at_b, b, angle_b
    return best, rho, theta


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
    columns = 2 if n == 3 else ANGLES
    radii, angles, table = np.zeros(RADII + 1), np.zeros(columns), np.zeros((RADII + 1, columns))
    for i in range(RADII):
        radii[i + 1] = NEAREST * (FARTHEST / NEAREST) ** (i / (RADII - 1))
    for j in range(columns):
        angles[j] = 2.0 * np.pi * j / columns
    none = (0.0, 1.0, 0.0, 1.0)
    nearest, rho, theta = _least(1, none, scene, q, table, radii, angles)
    if not nearest < np.inf:
        return False
    most = _worth(rho, theta, 0, none, scene, q)
    least, far, around = _least(0, none, scene, q, table, radii, angles)
    if weight <= 0.0:
        rho, theta = far, around
    elif weight < 1.0 and far > rho and most > least:
        ranges = (weight, np.sqrt(far**2 - rho**2), least, most - least)
        _, rho, theta = _least(2, ranges, scene, q, table, radii, angles)
    _worth(rho, theta, 0, none, scene, q)
    return True
