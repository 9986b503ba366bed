"""Integrate many motions side by side, each with steps of its own, by Dormand & Prince's fifth-order pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.integrate import RK45

from paretoik.resolution.equation_of_motion import EquationOfMotion


@dataclass(frozen=True, kw_only=True)
class IntegrationOptions:
    """Settings of the step size control."""

    first_step: float = 1e-2  # share of the duration
    shortest_step: float = 1e-5  # share of the duration: shorter steps are those of a motion into a singularity
    safety: float = 0.9  # factor of the step length that the error estimate allows (Hairer et al. 1993, section II.4)
    smallest_change: float = 0.2  # of a step length from one step to the next
    largest_change: float = 5.0


OPTIONS = IntegrationOptions()


def integrate(
    equation: EquationOfMotion,
    start: Float[np.ndarray, "motions state"],
    times: Float[np.ndarray, " time"],
    tolerance: float | Float[np.ndarray, " motions"],
) -> Float[np.ndarray, "motions time state"]:
    """Return states at ``times``, NaN from the sample that a motion does not reach.

    ``tolerance`` is that of every step, of positions and velocities, relative where they are larger than 1.
    """
    states = np.full((len(start), len(times), start.shape[1]), np.nan)
    duration = times[-1] - times[0]
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=float), (len(start),))
    t, y = np.full(len(start), times[0]), start.copy()
    length = np.full(len(start), OPTIONS.first_step * duration)
    with np.errstate(all="ignore"):  # towards a singularity numbers overflow, and shorter steps are tried
        rate = equation(t, y)
        for sample, end in enumerate(times):
            while len(active := np.flatnonzero((t < end) & (length > OPTIONS.shortest_step * duration))):
                remaining = end - t[active]
                step = np.minimum(length[active], remaining)
                trial, last_rate, error = _step(equation, t[active], y[active], rate[active], step, allowed[active])
                accepted, whole = error <= 1, step == remaining
                change = OPTIONS.safety * np.maximum(error, 1e-10) ** -0.2
                proposal = step * np.clip(change, OPTIONS.smallest_change, OPTIONS.largest_change)
                length[active] = np.where(accepted & whole, np.maximum(length[active], proposal), proposal)
                moved = active[accepted]
                t[moved] = np.where(whole, end, t[active] + step)[accepted]
                y[moved], rate[moved] = trial[accepted], last_rate[accepted]
            arrived = t >= end
            states[arrived, sample] = y[arrived]
    return states


def _step(
    equation: EquationOfMotion,
    t: np.ndarray,
    y: np.ndarray,
    rate: np.ndarray,
    step: np.ndarray,
    tolerance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (state, its rate, error over tolerance) after one step each. Source: Dormand & Prince 1980."""
    stages, h = [rate], step[:, None]
    for row, share in zip(RK45.A[1:], RK45.C[1:], strict=True):
        stages.append(equation(t + share * step, y + h * _combine(row, stages)))
    trial = y + h * _combine(RK45.B, stages)
    stages.append(equation(t + step, trial))
    error = np.abs(h * _combine(RK45.E, stages))
    allowed = tolerance[:, None] * np.maximum(1.0, np.maximum(np.abs(y), np.abs(trial)))
    ratio = np.max(error / allowed, axis=1)
    return trial, stages[-1], np.where(np.isfinite(ratio), ratio, np.inf)


def _combine(weights: np.ndarray, stages: list[np.ndarray]) -> np.ndarray:
    """Return Σ weights · stages, term by term: a matrix product rounds differently with the number of motions."""
    total = weights[0] * stages[0]
    for weight, stage in zip(weights[1 : len(stages)], stages[1:], strict=True):
        total += weight * stage
    return np.asarray(total)
