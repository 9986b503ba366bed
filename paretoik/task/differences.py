"""Finite differences and quadrature: the discretisations of a motion.

"backward" as in Tringali & Cocuzza 2020: v₀ = a₀ = 0, vᵢ = (qᵢ − qᵢ₋₁)/Δt, aᵢ = (vᵢ − vᵢ₋₁)/Δt, integrals by the
rectangle at the right end. "central": second order, integrals by the trapezoid rule. On a cycle v₀ = v_N. "spline": the
derivatives of the cubic spline near the samples (``task.spline``), integrals by Simpson's rule with midpoints.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Series

Differences: TypeAlias = Literal["backward", "central", "spline"]
Samples: TypeAlias = Float[np.ndarray, "*batch time columns"]
Instants: TypeAlias = Float[np.ndarray, "*#batch time"]


def first_derivative(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the first time derivatives of values (*batch, time, columns) at their samples."""
    if differences == "central":
        return _central_first_derivative(values, time, cyclic=cyclic)
    velocity = np.empty_like(values)
    velocity[..., 1:, :] = np.diff(values, axis=-2) / np.diff(time)[..., None]
    velocity[..., 0, :] = velocity[..., -1, :] if cyclic else 0.0
    return velocity


def second_derivative(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the second time derivatives of values (*batch, time, columns) at their samples."""
    if differences == "backward":
        first = first_derivative(values, time, differences, cyclic=cyclic)
        return first_derivative(first, time, differences, cyclic=cyclic)
    change, step = _steps(values, time, cyclic=cyclic)
    inner: Samples = 2 * np.diff(change / step, axis=-2) / (step[..., :-1, :] + step[..., 1:, :])
    if cyclic:
        return inner
    return np.concatenate([inner[..., :1, :], inner, inner[..., -1:, :]], axis=-2)


def quadrature_weights(time: Series, differences: Differences) -> Series:
    """Return the weights (*batch, time) [s] of an integral over the samples."""
    step = np.diff(time)
    zero = np.zeros((*step.shape[:-1], 1))
    left, right = np.concatenate([zero, step], axis=-1), np.concatenate([step, zero], axis=-1)
    return left if differences == "backward" else (left + right) / 2


def simpson_weights(time: Series) -> Series:
    """Return the weights (*batch, time) [s] of Simpson's rule: every other time is in the middle of its neighbours."""
    sixth = (time[..., 2::2] - time[..., :-2:2]) / 6
    weights = np.zeros(time.shape)
    weights[..., :-2:2] += sixth
    weights[..., 1::2] += 4 * sixth
    weights[..., 2::2] += sixth
    return weights


def with_midpoints(time: Series) -> Series:
    """Return times (*batch, 2 · time − 1) with the middle of every interval."""
    dense = np.empty((*time.shape[:-1], 2 * time.shape[-1] - 1))
    dense[..., ::2] = time
    dense[..., 1::2] = (time[..., 1:] + time[..., :-1]) / 2
    return dense


def _central_first_derivative(values: Samples, time: Instants, *, cyclic: bool) -> Samples:
    change, step = _steps(values, time, cyclic=cyclic)
    slope = change / step
    before, after = step[..., :-1, :], step[..., 1:, :]
    inner: Samples = (slope[..., :-1, :] * after + slope[..., 1:, :] * before) / (before + after)
    if cyclic:
        return inner
    first = 2 * slope[..., :1, :] - inner[..., :1, :]
    last = 2 * slope[..., -1:, :] - inner[..., -1:, :]
    return np.concatenate([first, inner, last], axis=-2)


def _steps(values: Samples, time: Instants, *, cyclic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the changes of values and time from sample to sample; a cycle is continued by one step at each end."""
    change, step = np.diff(values, axis=-2), np.diff(time)[..., None]
    if not cyclic:
        return change, step
    change, step = (np.concatenate([part[..., -1:, :], part, part[..., :1, :]], axis=-2) for part in (change, step))
    return change, step
