"""Fields of ellipses and directional maxima for the tests of speed models and of their fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.capability.speed_models import AxesEllipses, PolynomialEllipsoids, Polynomials, monomials

TASKS = [2, 3]


def units(size, *, task=2, seed=0):
    """Return unit vectors, evenly of half the circle, or of the sphere."""
    if task == 2:
        angles = np.pi * np.arange(size) / size
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    drawn = np.random.default_rng(seed).normal(size=(size, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def field(task, *, degree=2, seed=0):
    """Return a model of random ellipsoids about the middle of a box of 0.2 m, with speeds about 2 m/s."""
    rng = np.random.default_rng(seed)
    terms = len(monomials(task, degree))
    entries = 0.05 * rng.normal(size=(terms, task, task))
    entries = entries + np.swapaxes(entries, 1, 2)
    entries[0] += np.eye(task)
    log_scale = 0.3 * rng.normal(size=terms)
    log_scale[0] = np.log(2.0)
    center = np.array([0.4, -0.3, 0.2])[:task]
    columns = np.column_stack([log_scale, entries[:, *np.triu_indices(task)]])
    polynomials = Polynomials(degree=degree, center=center, scale=0.1, coefficients=columns)
    return PolynomialEllipsoids(polynomials=polynomials, lower=center - 0.1, upper=center + 0.1)


def constant_shape(model):
    """Return ellipsoids of the same sizes, all of one shape."""
    columns = model.polynomials.coefficients.copy()
    columns[1:, 1:] = 0.0
    return replace(model, polynomials=replace(model.polynomials, coefficients=columns))


def axes_field(*, turn):
    """Return radii and an angle that are polynomials; the angle passes ±90°, at which eigenvectors jump."""
    numbers = np.array([[2.0, 1.0, 1.5], [0.3, -0.1, turn], [0.2, 0.2, 0.4], [0.1, 0, 0.1], [0, 0.1, 0], [0, 0, 0.2]])
    center = np.array([0.15, -0.15])
    axes = Polynomials(degree=2, center=center, scale=0.05, coefficients=numbers)
    return AxesEllipses(axes=axes, lower=center - 0.05, upper=center + 0.05)


def within(model, size, *, seed=1):
    return np.random.default_rng(seed).uniform(model.lower, model.upper, size=(size, len(model.lower)))


def arm_maxima(positions, directions):
    """Return maxima of a planar arm of three joints: outlines of zonotopes, the best of 240 postures."""
    lengths, rates = np.array([0.114, 0.114, 0.129]), np.array([3.3, 13.2, 13.2])
    first = np.linspace(-np.pi, np.pi, 120, endpoint=False)
    wrist = positions[:, None] - lengths[0] * np.stack([np.cos(first), np.sin(first)], axis=1)
    cosine = (np.sum(wrist**2, axis=-1) - lengths[1] ** 2 - lengths[2] ** 2) / (2 * lengths[1] * lengths[2])
    elbow = np.arccos(np.clip(cosine, -1, 1)) * np.array([1, -1])[:, None, None]
    second = np.arctan2(wrist[..., 1], wrist[..., 0])
    second = second - np.arctan2(lengths[2] * np.sin(elbow), lengths[1] + lengths[2] * np.cos(elbow))
    angles = np.stack([np.broadcast_to(first, second.shape), second, second + elbow], axis=-1)
    links = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    normals = np.cumsum(links[..., ::-1, :], axis=-2)[..., ::-1, :]  # from each joint to the tool, orthogonal to
    turned = np.stack([-normals[..., 1], normals[..., 0]], axis=-1)  # the velocity that it gives
    reach = np.abs(np.einsum("...id,...jd->...ij", normals, turned)) @ rates
    speeds = np.min(reach[..., None] / np.maximum(np.abs(normals @ directions.T), 1e-9), axis=-2)
    return np.max(np.where((np.abs(cosine) < 0.9999)[..., None], speeds, 0.0), axis=(0, 2))


def grid(side):
    x, y = np.meshgrid(np.linspace(0.1, 0.2, side), np.linspace(-0.2, -0.1, side), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1)


def log_errors(model, positions, directions, speeds):
    return np.log(model.speeds(positions, directions) / speeds)


def differences(function, positions, *, nearby=1e-6):
    sides = nearby * np.eye(positions.shape[-1])
    return np.stack([(function(positions + e) - function(positions - e)) / (2 * nearby) for e in sides], axis=-1)
