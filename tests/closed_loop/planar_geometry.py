"""Collisions of a planar arm by independent geometry: a reference for ``task/distances`` and the engine."""

from __future__ import annotations

import numpy as np

from paretoik.collision.obstacles import Circle


def joints_of(q):
    """Return the joints (..., nodes) of arms of unit links as complex numbers."""
    steps = np.cumsum(np.exp(1j * np.cumsum(q, axis=-1)), axis=-1)
    return np.concatenate([np.zeros((*q.shape[:-1], 1)), steps], axis=-1)


def meets(q, obstacles):
    """Return which arms (..., dof) of unit links meet a circle, or a box along the axes (Liang & Barsky 1984)."""
    nodes = joints_of(q)
    start, end = nodes[..., :-1], nodes[..., 1:]
    met = np.zeros(q.shape[:-1], dtype=bool)
    for obstacle in obstacles:
        if isinstance(obstacle, Circle):
            center, step = complex(*obstacle.center), end - start
            share = np.clip(((center - start) * step.conj()).real / np.abs(step) ** 2, 0, 1)
            met |= (np.abs(start + share * step - center) <= obstacle.radius).any(axis=-1)
            continue
        first, last = np.zeros(start.shape), np.ones(start.shape)
        for part, center, half in zip((np.real, np.imag), obstacle.pose.position, obstacle.half_sizes, strict=False):
            a, d = part(start) - center, part(end - start)
            one, other = (-half - a) / d, (half - a) / d
            first, last = np.maximum(first, np.minimum(one, other)), np.minimum(last, np.maximum(one, other))
        met |= (first <= last).any(axis=-1)
    return met
