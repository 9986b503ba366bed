"""One step within limits: the quadratic program of joint rates, stated about the rates that no limit would change.

With rates z that the criteria ask for and weights W, a step solves

minimise    ½ (q̇ − z)ᵀ W (q̇ − z)
subject to  J q̇ = v                       what the task asks for
            lower ≤ q̇ ≤ upper             joint limits, as rates
            ∇d · q̇ ≥ −approach            distances from obstacles

where the task is damped by ρ, or limits leave it no solution, it gives way:

minimise    ½ ‖J q̇ − v‖² + ½ ρ² (q̇ − z)ᵀ W (q̇ − z)

About the solution without limits, q̇ = free + W^(−½) N x, both are: minimise ½ xᵀ P x subject to Gx ≤ h. P = I along
the null space N of J W^(−½), or P = I + W^(−½) Jᵀ J W^(−½) / ρ² and N = I. The convex subproblem of the SQP solves it
where a limit is active.

Source: Cheng, Chen & Sun 1994, Resolving Manipulator Redundancy under Inequality Constraints; of the distances
Faverjon & Tournassoud 1987.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, dense_rows
from paretoik.nlp.subproblem import solve_subproblem
from paretoik.resolution.traces import DAMPED, DONE, HELD, LIMITED


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """Tolerances of a step within limits."""

    tolerance: float = 1e-9  # share of the largest rate without limits, or bound: limits exceeded by less are kept
    singular: float = 1e-13  # share of the largest singular value: the Jacobian counts as singular
    least_damping: float = 1e-4  # share of the largest singular value, where the task gives way and nothing is damped
    penalty: float = 1e6  # of a rate by which a distance shrinks too fast, in shares of the largest


OPTIONS = StepOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class StepGoal:
    """What a step is to do: the task's rates, those of the criteria, inverse weights D of joints, and damping."""

    jacobian: Float[np.ndarray, "rows dof"]
    task_rates: Float[np.ndarray, " rows"]
    secondary: Float[np.ndarray, " dof"]
    inverse_weights: Float[np.ndarray, " dof"]
    region: float
    damping: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StepLimits:
    """Bounds of joint rates, and the least rates of distances with these gradients."""

    bounds: Float[np.ndarray, "dof 2"]
    gradients: Float[np.ndarray, "distances dof"]
    lowest_rates: Float[np.ndarray, " distances"]

    def slack(self, rates: Float[np.ndarray, " dof"]) -> Float[np.ndarray, " limits"]:
        """Return what rates leave of every limit: of distances, then lower and upper bounds; negative past it."""
        return np.concatenate(
            [self.gradients @ rates - self.lowest_rates, rates - self.bounds[:, 0], self.bounds[:, 1] - rates]
        )

    def keep(self, rates: Float[np.ndarray, " dof"], free: Float[np.ndarray, " dof"]) -> bool:
        """Return whether rates keep every limit, to a share of the rates without limits, or of bounds if less."""
        size = min(float(np.abs(free).max()), float(np.abs(self.bounds).max()))
        return bool(self.slack(rates).min() >= -OPTIONS.tolerance * size)


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitedStep:
    """The rates of a step and those without limits, the projector onto what the task leaves free, the damping ρ.

    ``status`` is an index into STATUS.
    """

    rates: Float[np.ndarray, " dof"]
    free: Float[np.ndarray, " dof"]
    projector: Float[np.ndarray, "dof dof"]
    damping: float
    status: int


def limited_step(goal: StepGoal, limits: StepLimits) -> LimitedStep:
    """Return the step: as without limits where it keeps them, else by the quadratic program."""
    root = np.sqrt(goal.inverse_weights)
    weighted = goal.jacobian * root
    U, sizes, V = np.linalg.svd(weighted)
    rows, largest, smallest = len(sizes), float(sizes[0]), float(sizes[-1])

    def step(damping: float, status: int, rates: np.ndarray | None = None) -> LimitedStep:
        inverse = root[:, None] * V[:rows].T * (sizes / (sizes**2 + damping**2)) @ U.T
        projector = np.eye(len(root)) - inverse @ goal.jacobian
        free = inverse @ goal.task_rates + projector @ goal.secondary
        rates = free if rates is None else rates
        return LimitedStep(rates=rates, free=free, projector=projector, damping=damping, status=status)

    if goal.damping > 0 and smallest < goal.region:
        damping = float(goal.damping * np.sqrt(1 - (smallest / goal.region) ** 2))  # Wan et al. 2018, Eq. 4
        without = step(damping, DAMPED)
    elif smallest > OPTIONS.singular * largest:
        damping, without = goal.damping, step(0.0, DONE)
    else:
        still = _still(root, limits)
        return replace(step(1.0, HELD if limits.keep(still, still) else LIMITED, still), free=still)
    if limits.keep(without.free, without.free):
        return without
    identity = np.eye(len(root))
    if without.status == DONE:
        rates = _nearest(without.free, V[rows:].T, root, identity[rows:, rows:], limits)
        if rates is not None and limits.keep(rates, without.free):
            return replace(without, rates=rates)
    relaxed = step(max(damping, OPTIONS.least_damping * largest), LIMITED if without.status == DONE else DAMPED)
    rates = _nearest(relaxed.free, identity, root, identity + weighted.T @ weighted / relaxed.damping**2, limits)
    if rates is None:
        rates = np.clip(relaxed.free, *limits.bounds.T)
    return replace(relaxed, rates=rates, status=relaxed.status if limits.keep(rates, relaxed.free) else LIMITED)


def _still(root: Float[np.ndarray, " dof"], limits: StepLimits) -> Float[np.ndarray, " dof"]:
    """Return the least rates that keep the limits, or, where no rates do, those within the bounds of joints."""
    zeros, identity = np.zeros_like(root), np.eye(len(root))
    rates: np.ndarray = np.clip(zeros, *limits.bounds.T)
    if limits.slack(rates).min() >= 0:
        return rates
    nearest = _nearest(zeros, identity, root, identity, limits)
    return rates if nearest is None else nearest


def _nearest(free: np.ndarray, N: np.ndarray, root: np.ndarray, P: np.ndarray, limits: StepLimits) -> np.ndarray | None:
    """Return free + root N x within limits, x of least ½ xᵀPx; None for no such rates.

    Where bounds of rates allow for no others, distances shrink as little too fast as they can.
    """
    values, distances, basis = limits.slack(free), len(limits.lowest_rates), root[:, None] * N
    G = np.concatenate([limits.gradients @ basis, basis, -basis])
    size = max(float(np.abs(free).max()), float(-values.min()))
    farthest = np.abs(limits.bounds - free[:, None]).max(axis=1) / size
    radius = float((np.abs(N.T) @ (farthest / root)).max())
    constraints = Constraints(unknowns=len(P), values=values / size, jacobian=dense_rows(G))
    out_of_reach = values / size + np.abs(G).sum(axis=1) * radius < 0
    if out_of_reach[distances:].any():
        return None
    try:
        solution = solve_subproblem(
            np.zeros(len(P)),
            dense_rows(P / np.abs(P).max()),
            constraints,
            elastic=distances,
            radius=radius,
            penalty=OPTIONS.penalty,
        )
    except SolverFailed:
        return None
    return np.asarray(free + size * (basis @ solution.step))
