"""Minimisers over the steps of a planar arm, compiled: golden sections, a simplex, Newton's method."""

from __future__ import annotations

import numpy as np

from paretoik.closed_loop.null_space_steps import merit, step_error
from paretoik.compilation import compiled, inlined
from paretoik.nlp.compiled.scalar_search import golden_section


@inlined
def _merit_at(rho, arguments):
    theta, quantity, ranges, s, q = arguments
    return merit(rho, step_error(rho, theta, s, q), quantity, ranges)


@compiled
def minimise_along(low, high, theta, quantity, ranges, options, s, q):
    """Return (merit, ρ) of the minimum between two radii, by golden sections; from blocked ones towards the middle."""
    arguments, middle = (theta, quantity, ranges, s, q), 0.5 * (low + high)
    return golden_section(_merit_at, arguments, low, high, options.golden_iterations, middle)


@compiled
def nelder_mead(rho, theta, size, quantity, ranges, options, s, q, simplex):
    """Return (merit, ρ, θ) of the minimum that a simplex about a step leads to (Nelder & Mead 1965)."""
    for i in range(3):
        simplex[i, 0] = rho * np.cos(theta) + (size if i == 1 else 0.0)
        simplex[i, 1] = rho * np.sin(theta) + (size if i == 2 else 0.0)
        simplex[i, 2] = _merit_of_plane(simplex[i, 0], simplex[i, 1], quantity, ranges, s, q)
    for _ in range(options.simplex_iterations):
        _sort_simplex(simplex)
        diameter = max(abs(simplex[2, 0] - simplex[0, 0]), abs(simplex[2, 1] - simplex[0, 1]))
        if diameter < options.simplex_tolerance * rho:
            break
        _move_simplex(quantity, ranges, s, q, simplex)
    best = 0
    for i in range(1, 3):
        best = i if simplex[i, 2] < simplex[best, 2] else best
    u, v = simplex[best, 0], simplex[best, 1]
    return simplex[best, 2], np.hypot(u, v), np.arctan2(v, u)


@inlined
def _merit_of_plane(u, v, quantity, ranges, s, q):
    rho = np.hypot(u, v)
    return merit(rho, step_error(rho, np.arctan2(v, u), s, q), quantity, ranges)


@compiled
def _sort_simplex(simplex):
    """Sort the corners, the best first."""
    for i in range(2):
        for k in range(2 - i):
            if simplex[k, 2] > simplex[k + 1, 2]:
                for m in range(3):
                    simplex[k, m], simplex[k + 1, m] = simplex[k + 1, m], simplex[k, m]


@compiled
def _move_simplex(quantity, ranges, s, q, simplex):
    """Reflect, expand or contract the worst corner, or shrink all towards the best."""
    u, v = 0.5 * (simplex[0, 0] + simplex[1, 0]), 0.5 * (simplex[0, 1] + simplex[1, 1])
    du, dv = u - simplex[2, 0], v - simplex[2, 1]
    factor, value = 1.0, _merit_of_plane(u + du, v + dv, quantity, ranges, s, q)
    if value < simplex[0, 2]:
        expanded = _merit_of_plane(u + 2.0 * du, v + 2.0 * dv, quantity, ranges, s, q)
        if expanded < value:
            factor, value = 2.0, expanded
    elif value >= simplex[1, 2]:
        factor = 0.5 if value < simplex[2, 2] else -0.5
        value = _merit_of_plane(u + factor * du, v + factor * dv, quantity, ranges, s, q)
    if value < simplex[2, 2]:
        simplex[2, 0], simplex[2, 1], simplex[2, 2] = u + factor * du, v + factor * dv, value
        return
    for i in range(1, 3):
        for m in range(2):
            simplex[i, m] = 0.5 * (simplex[i, m] + simplex[0, m])
        simplex[i, 2] = _merit_of_plane(simplex[i, 0], simplex[i, 1], quantity, ranges, s, q)


@compiled
def newton(rho, theta, options, s):
    """Return (error, ρ, θ) that Newton's method leads to from a step, with two redundant degrees."""
    lengths, null_space = s.lengths, s.null_space
    u, v = rho * np.cos(theta), rho * np.sin(theta)
    error = np.inf
    for _ in range(options.newton_iterations):
        x, y, angle = -s.target[0], -s.target[1], 0.0
        a, b, c, d, first, second = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(lengths.shape[0]):
            angle += s.base[k] + null_space[k, 0] * (s.center[0] + u) + null_space[k, 1] * (s.center[1] + v)
            first, second = first + null_space[k, 0], second + null_space[k, 1]
            dx, dy = lengths[k] * np.cos(angle), lengths[k] * np.sin(angle)
            x, y = x + dx, y + dy
            a, b, c, d = a - dy * first, b - dy * second, c + dx * first, d + dx * second
        error, determinant = np.hypot(x, y), a * d - b * c
        if error < options.error_tolerance or not abs(determinant) > options.error_tolerance:
            break
        u, v = u - (d * x - b * y) / determinant, v - (a * y - c * x) / determinant
    return error, np.hypot(u, v), np.arctan2(v, u)
