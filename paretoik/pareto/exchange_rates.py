"""How objectives trade at a point of a front: rates from multipliers, and intervals where these are not unique."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.nlp.conic import Constraints
from paretoik.nlp.multiplier_set import share_ranges


@dataclass(frozen=True, kw_only=True)
class ExchangeRateOptions:
    """Tolerances of multipliers; none has a unit."""

    weight: float = 1e-6  # share of all objectives' weight from which on one counts
    active: float = 1e-7  # slack, of a limit's range, up to which it is active
    unique: float = 1e-3  # relative width of an interval from which on no single rate stands for it


OPTIONS = ExchangeRateOptions()


def exchange_rates(
    weights: Float[np.ndarray, "points n_obj"],
    ratios: Float[np.ndarray, "points n_obj n_obj 2"],
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
) -> Float[np.ndarray, "points n_obj n_obj"]:
    """Return ∂f_j/∂f_i = −λ_i/λ_j, the others held, in natural units and the objectives' own signs; diagonal 1.

    NaN where a weight is none, or the ends of λ_i/λ_j are not known or apart.
    """
    reliable, natural = np.where(weights >= OPTIONS.weight, weights, np.nan), ranges * signs
    rates = -reliable[:, :, None] / reliable[:, None, :] * natural[None, None, :] / natural[None, :, None]
    with np.errstate(invalid="ignore"):  # an end may be infinite
        unique = ratios[..., 1] - ratios[..., 0] <= OPTIONS.unique * ratios[..., 0]
    rates[~unique] = np.nan
    i = np.arange(len(ranges))
    rates[:, i, i] = 1.0
    return rates


def exchange_intervals(
    ratios: Float[np.ndarray, "points n_obj n_obj 2"],
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
) -> Float[np.ndarray, "points n_obj n_obj 2"]:
    """Return the ends of ∂f_j/∂f_i, lower first, for the ends of λ_i/λ_j."""
    natural = ranges * signs
    rates = -ratios * (natural[None, :] / natural[:, None])[..., None]
    i = np.arange(len(ranges))
    rates[:, i, i] = 1.0
    return np.sort(rates, axis=-1)


def weight_ratios(
    gradients: Float[np.ndarray, "n_obj columns"], constraints: Constraints, weights: Float[np.ndarray, " n_obj"]
) -> Float[np.ndarray, "n_obj n_obj 2"]:
    """Return the least and largest λ_i/λ_j over all multipliers that make a point critical; NaN where one is none.

    With cones they are taken for unique. Raises SolverFailed where their range cannot be computed.
    """
    reliable = np.where(weights >= OPTIONS.weight, weights, np.nan)
    ratios = reliable[:, None] / reliable[None, :]
    intervals = np.stack([ratios, ratios], axis=-1)
    if constraints.cones:
        return intervals
    active = constraints.jacobian[constraints.values <= OPTIONS.active].toarray()
    shares = share_ranges(gradients, active, constraints.unknowns)
    if shares is None:
        return intervals
    with np.errstate(divide="ignore"):
        ends = shares / np.where(1.0 - shares >= OPTIONS.weight, 1.0 - shares, 0.0)
    ends[shares < OPTIONS.weight] = 0.0
    within = np.stack([np.minimum(ends[..., 0], ratios), np.maximum(ends[..., 1], ratios)], axis=-1)
    return np.where(np.isnan(ratios)[..., None], np.nan, within)
