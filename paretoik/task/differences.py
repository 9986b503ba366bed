"""From samples to rates and integrals: the two discretisations of a motion.

"backward" as in Tringali & Cocuzza 2020: v₀ = a₀ = 0, vᵢ = (qᵢ − qᵢ₋₁)/Δt, aᵢ = (vᵢ − vᵢ₋₁)/Δt, integrals by the
rectangle at the right end. "central": second order, integrals by the trapezoid rule. On a cycle v₀ = v_N.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Series

Differences: TypeAlias = Literal["backward", "central"]
Samples: TypeAlias = Float[np.ndarray, "*batch time columns"]
Instants: TypeAlias = Float[np.ndarray, "*#batch time"]


def rate(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the rates of change of values (*batch, time, columns) at their samples."""
    if differences == "central":
        return _central_first(values, time, cyclic=cyclic)
    found = np.empty_like(values)
    found[..., 1:, :] = np.diff(values, axis=-2) / np.diff(time)[..., None]
    found[..., 0, :] = found[..., -1, :] if cyclic else 0.0
    return found


def second_rate(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the second rates of change of values (*batch, time, columns) at their samples."""
    if differences == "backward":
        return rate(rate(values, time, differences, cyclic=cyclic), time, differences, cyclic=cyclic)
    change, step = _changes(values, time, cyclic=cyclic)
    inner: Samples = 2 * np.diff(change / step, axis=-2) / (step[..., :-1, :] + step[..., 1:, :])
    if cyclic:
        return inner
    return np.concatenate([inner[..., :1, :], inner, inner[..., -1:, :]], axis=-2)


def quadrature(time: Series, differences: Differences) -> Series:
    """Return the weights (*batch, time) [s] of an integral over the samples."""
    step = np.diff(time)
    nothing = np.zeros((*step.shape[:-1], 1))
    after, before = np.concatenate([nothing, step], axis=-1), np.concatenate([step, nothing], axis=-1)
    return after if differences == "backward" else (after + before) / 2


def _central_first(values: Samples, time: Instants, *, cyclic: bool) -> Samples:
    change, step = _changes(values, time, cyclic=cyclic)
    slope = change / step
    before, after = step[..., :-1, :], step[..., 1:, :]
    inner: Samples = (slope[..., :-1, :] * after + slope[..., 1:, :] * before) / (before + after)
    if cyclic:
        return inner
    first = 2 * slope[..., :1, :] - inner[..., :1, :]
    last = 2 * slope[..., -1:, :] - inner[..., -1:, :]
    return np.concatenate([first, inner, last], axis=-2)


def _changes(values: Samples, time: Instants, *, cyclic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return changes from sample to sample and their times, those of a cycle continued round its seam."""
    change, step = np.diff(values, axis=-2), np.diff(time)[..., None]
    if not cyclic:
        return change, step
    around = [np.concatenate([part[..., -1:, :], part, part[..., :1, :]], axis=-2) for part in (change, step)]
    return around[0], around[1]
