"""How much all objectives can gain at once, to first order: the criticality χ of a point.

maximise    t
subject to  ∇fᵢ·d + t ≤ 0 for every objective
            c + J d ≥ 0, c at least 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. A second-order cone program, stated in cvxpy, canonicalised once
for each sparsity pattern and solved by Clarabel. Source: Fliege & Svaiter 2000, Eq. 2, with a ball in place of their
quadratic term.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.interruption import check_interruption
from paretoik.nlp.canonical import CanonicalForm, Parameters, Pattern, Statement, parameter_values, state_cones
from paretoik.nlp.conic import Constraints


@dataclass(frozen=True, kw_only=True)
class CriticalityOptions:
    """How the criticality is computed; no field has a unit."""

    near_share: float = 0.01  # of the radius: inequalities that no step so short reaches are left out at first
    gain_tolerance: float = 1e-10  # of the steepest gradient's length: a gain that is as good as 0
    solver_tolerances: tuple[float, ...] = (1e-11, 1e-9)  # of Clarabel's gaps and infeasibilities, until one is met


OPTIONS = CriticalityOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Criticality:
    """``value`` χ, the step that attains it, ``weights`` λ of the objectives, Σλ = 1, and multipliers μ of the rest."""

    value: float
    step: Float[np.ndarray, " columns"]
    weights: Float[np.ndarray, " objectives"]
    multipliers: Float[np.ndarray, " inequalities"]
    cone_multipliers: tuple[np.ndarray, ...] = ()


def criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality where objectives have these gradients.

    The nearest inequalities alone come first: with fewer χ can only be greater, so that χ = 0 with them is χ = 0
    with all. Raises SolverFailed where Clarabel ends without a solution.
    """
    check_interruption()
    program, scale = _program(Pattern.of(constraints), len(gradients)), _scale(gradients)
    near = constraints.within_reach(OPTIONS.near_share * radius, order=2)
    first = program.solve(gradients, constraints, radius, near)
    if first.value <= OPTIONS.gain_tolerance * scale:
        return first
    return program.solve(gradients, constraints, radius, constraints.within_reach(radius, order=2))


class _CriticalityProgram:
    """The program of one sparsity pattern, canonicalised."""

    def __init__(self, pattern: Pattern, objectives: int) -> None:
        self._rows, self._objectives, self._unknowns = pattern.jacobian.shape[0], objectives, pattern.unknowns
        statement = _state(pattern, objectives)
        self._form = CanonicalForm(statement)
        self._d, self._t = self._form.columns(statement.d), self._form.columns(statement.t)

    def solve(self, gradients: np.ndarray, constraints: Constraints, radius: float, near: np.ndarray) -> Criticality:
        """Return the criticality with the inequalities ``near`` alone."""
        scale, norms = _scale(gradients), constraints.row_norms
        slacks = np.maximum(constraints.values, 0.0) / norms
        first = (gradients / scale).ravel(), [radius], slacks
        numbers = parameter_values(*first, constraints=constraints, scales=norms)
        used = self._form.rows_in_use(self._rows, near)
        x, dual = self._solve(numbers, used)
        multipliers, end = np.zeros(self._rows), len(near) + self._objectives
        multipliers[near] = dual[: len(near)] * scale / norms[near]
        weights = dual[len(near) : end]
        return Criticality(
            value=max(float(x[self._t[0]]), 0.0) * scale,
            step=x[self._d],
            weights=weights / weights.sum(),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(dual[end + 1 + self._unknowns :] * scale),
        )

    def _solve(self, numbers: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and dual variables; raises SolverFailed where Clarabel ends without a solution at any tolerance."""
        for tolerance in OPTIONS.solver_tolerances[:-1]:
            try:
                return self._form.solve("criticality", numbers, used, tolerance)
            except SolverFailed:  # no progress below what rounding leaves
                continue
        return self._form.solve("criticality", numbers, used, OPTIONS.solver_tolerances[-1])


_program = lru_cache(maxsize=64)(_CriticalityProgram)  # canonicalised statements


def _state(pattern: Pattern, objectives: int) -> Statement:
    import cvxpy  # here: importing it takes two seconds

    (rows, columns), parameters = pattern.jacobian.shape, Parameters()
    d, t = cvxpy.Variable(columns), cvxpy.Variable()
    gradients, radius = parameters.dense(objectives, columns), parameters.dense()
    inequalities = parameters.dense(rows) + parameters.sparse(pattern.jacobian) @ d >= 0 if rows else None
    constraints = [] if inequalities is None else [inequalities]
    constraints += [gradients @ d + t <= 0, cvxpy.SOC(radius, d[: pattern.unknowns])]
    cones = state_cones(pattern, d, parameters)
    problem = cvxpy.Problem(cvxpy.Maximize(t), constraints + cones)
    return Statement(problem, parameters, d, t, inequalities, cones)


def _scale(gradients: np.ndarray) -> float:
    return max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
