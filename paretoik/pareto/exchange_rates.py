"""How objectives trade at a point of a front: rates from multipliers, and intervals where these are not unique."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

from paretoik.nlp.conic import Constraints


@dataclass(frozen=True, kw_only=True)
class ExchangeRateOptions:
    """Tolerances of multipliers, all without unit.

    ``weight`` is the share of all objectives' weight from which on one counts; ``active`` the slack, of a limit's
    range, up to which it is active; ``singular`` the singular value, of rows of length one, that counts as none;
    ``balance`` what may be left of a gradient that multipliers cancel, as a share of the longest. A linear program ends
    after so many ``pivots``: where nearly all rows are active, the simplex method may cycle.
    """

    weight: float = 1e-6
    active: float = 1e-7
    singular: float = 1e-7
    balance: float = 1e-7
    pivots: int = 5000


OPTIONS = ExchangeRateOptions()


def exchange_rates(
    weights: Float[np.ndarray, "points n_obj"], ranges: Float[np.ndarray, " n_obj"], signs: Float[np.ndarray, " n_obj"]
) -> Float[np.ndarray, "points n_obj n_obj"]:
    """Return ∂f_j/∂f_i = −λ_i/λ_j, the others held, in natural units and the objectives' own signs; diagonal 1."""
    counts = np.where(weights >= OPTIONS.weight, weights, np.nan)
    natural = ranges * signs
    rates = -weights[:, :, None] / counts[:, None, :] * natural[None, None, :] / natural[None, :, None]
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
    """Return the least and largest λ_i/λ_j over all multipliers that make a point critical; NaN where λ_j is none.

    Where gradients of objectives and of limits that are reached depend on each other in more than one way, multipliers
    are not unique: two linear programs, scaled to λ_j = 1, give the ends. With cones they are taken for unique.
    """
    counts = np.where(weights >= OPTIONS.weight, weights, np.nan)
    ratios = weights[:, None] / counts[None, :]
    intervals = np.stack([ratios, ratios], axis=-1)
    active = constraints.jacobian[constraints.values <= OPTIONS.active].toarray()
    rows = np.concatenate([gradients, -active])
    lengths = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    rows = rows[lengths > 1e-12] / lengths[lengths > 1e-12, None]
    if constraints.cones or len(rows) - np.linalg.matrix_rank(rows, tol=OPTIONS.singular) <= 1:
        return intervals
    return np.stack([_ends(gradients, active, intervals[:, j], j) for j in range(len(weights))], axis=1)


def _ends(gradients: np.ndarray, active: np.ndarray, unique: np.ndarray, j: int) -> np.ndarray:
    """Return the ends (n_obj, 2) of λ_i where λ_j is 1; those that are ``unique`` where the programs have none."""
    if np.isnan(unique[j]).any():
        return unique
    table = np.concatenate([gradients, -active]).T / max(float(np.linalg.norm(gradients, axis=1).max()), 1e-300)
    within = np.concatenate([table, -table])
    others = [k for k in range(table.shape[1]) if k != j]
    right = np.concatenate([OPTIONS.balance - table[:, j], OPTIONS.balance + table[:, j]])
    ends = unique.copy()
    for i in range(len(gradients)):
        for side, sign in enumerate((1.0, -1.0)):
            cost = np.zeros(len(others))
            if i != j:
                cost[others.index(i)] = sign
            end = linprog(cost, A_ub=within[:, others], b_ub=right, method="highs", options={"maxiter": OPTIONS.pivots})
            if i != j and end.status == 0:
                ends[i, side] = max(sign * end.fun, 0.0)
            elif i != j and end.status == 3:  # λ_j may vanish beside λ_i
                ends[i, side] = np.inf
    return ends
