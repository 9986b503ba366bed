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

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.nlp.canonical import CanonicalForm, Parameters, Structure
from paretoik.nlp.conic import Constraints


@dataclass(frozen=True, kw_only=True)
class CriticalityOptions:
    """How the criticality is computed; no field has a unit."""

    near_share: float = 0.01  # of the radius: inequalities that no step so short reaches are left out at first
    gain_tolerance: float = 1e-10  # of the steepest gradient's length: a gain that is as good as 0
    solver_tolerance: float = 1e-11  # of Clarabel's gaps and infeasibilities


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
    program, scale = _program(_Pattern.of(gradients, constraints)), _scale(gradients)
    near = constraints.within_reach(OPTIONS.near_share * radius, order=2)
    first = program.solve(gradients, constraints, radius, near)
    if first.value <= OPTIONS.gain_tolerance * scale:
        return first
    return program.solve(gradients, constraints, radius, constraints.within_reach(radius, order=2))


class _Pattern(NamedTuple):
    """What the statement depends on besides numbers."""

    objectives: int
    unknowns: int
    jacobian: Structure
    cones: tuple[tuple[int, Structure], ...]

    @classmethod
    def of(cls, gradients: np.ndarray, constraints: Constraints) -> _Pattern:
        cones = tuple((cone.column, Structure.of(cone.rows)) for cone in constraints.cones)
        return cls(len(gradients), constraints.unknowns, Structure.of(constraints.jacobian), cones)


class _Statement(NamedTuple):
    """The statement in cvxpy."""

    problem: Any
    parameters: Parameters
    d: Any
    t: Any
    inequalities: Any
    gains: Any
    cones: list[Any]

    @classmethod
    def of(cls, pattern: _Pattern) -> _Statement:
        import cvxpy  # here: importing it takes two seconds

        (rows, columns), parameters = pattern.jacobian.shape, Parameters()
        d, t = cvxpy.Variable(columns), cvxpy.Variable()
        gradients, radius = parameters.dense(pattern.objectives, columns), parameters.dense()
        constraints, inequalities = [], None
        if rows:
            inequalities = parameters.dense(rows) + parameters.sparse(pattern.jacobian) @ d >= 0
            constraints = [inequalities]
        gains = gradients @ d + t <= 0
        constraints += [gains, cvxpy.SOC(radius, d[: pattern.unknowns])]
        cones = []
        for column, structure in pattern.cones:
            length, values = parameters.dense(), parameters.dense(structure.shape[0])
            cones.append(cvxpy.SOC(d[column] + length, values + parameters.sparse(structure) @ d))
        problem = cvxpy.Problem(cvxpy.Maximize(t), constraints + cones)
        return cls(problem, parameters, d, t, inequalities, gains, cones)


class _CriticalityProgram:
    """The program of one sparsity pattern, canonicalised."""

    def __init__(self, pattern: _Pattern) -> None:
        self._rows, self._objectives, self._unknowns = pattern.jacobian.shape[0], pattern.objectives, pattern.unknowns
        statement = _Statement.of(pattern)
        self._form = CanonicalForm(statement.problem, statement.parameters)
        self._d, self._t = self._form.columns(statement.d), self._form.columns(statement.t)

    def solve(self, gradients: np.ndarray, constraints: Constraints, radius: float, near: np.ndarray) -> Criticality:
        """Return the criticality with the inequalities ``near`` alone."""
        scale, norms = _scale(gradients), constraints.row_norms
        used = np.ones(self._form.rows, dtype=bool)
        used[: self._rows] = False
        used[near] = True
        numbers = _numbers(gradients / scale, constraints, radius, norms)
        solution = self._form.solve("criticality", numbers, None, used, OPTIONS.solver_tolerance)
        multipliers, first = np.zeros(self._rows), len(near) + self._objectives
        multipliers[near] = solution.dual[: len(near)] * scale / norms[near]
        weights = solution.dual[len(near) : first]
        return Criticality(
            value=max(float(solution.x[self._t[0]]), 0.0) * scale,
            step=solution.x[self._d],
            weights=weights / weights.sum(),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(solution.dual[first + 1 + self._unknowns :] * scale),
        )


@lru_cache(maxsize=64)  # canonicalised statements
def _program(pattern: _Pattern) -> _CriticalityProgram:
    return _CriticalityProgram(pattern)


def _scale(gradients: np.ndarray) -> float:
    return max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)


def _numbers(
    gradients: np.ndarray, constraints: Constraints, radius: float, scales: np.ndarray
) -> Float[np.ndarray, " numbers"]:
    """Return the values of all parameters, in the statement's order, inequalities divided by ``scales``."""
    numbers = [gradients.ravel(), [radius], np.maximum(constraints.values, 0.0) / scales]
    numbers.append(constraints.jacobian.data / scales[constraints.entries.row])
    for cone in constraints.cones:
        numbers += [[np.linalg.norm(cone.values)], cone.values, cone.rows.data]
    return np.concatenate(numbers)


def solve_with_cvxpy(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality by cvxpy's own solve of the same statement. Raises SolverFailed for no solution."""
    import cvxpy  # here: importing it takes two seconds

    statement = _Statement.of(_Pattern.of(gradients, constraints))
    statement.parameters.assign(_numbers(gradients, constraints, radius, np.ones(len(constraints.values))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # cvxpy reads its own sparse parameters as dense ones
        statement.problem.solve(solver=cvxpy.CLARABEL)
    if statement.d.value is None:
        raise SolverFailed(f"criticality: a solution wanted, got {statement.problem.status}")
    weights = np.array(statement.gains.dual_value)
    return Criticality(
        value=max(float(statement.problem.value), 0.0),
        step=np.array(statement.d.value),
        weights=weights / weights.sum(),
        multipliers=np.zeros(0) if statement.inequalities is None else np.array(statement.inequalities.dual_value),
        cone_multipliers=tuple(-np.ravel(cone.dual_value[1]) for cone in statement.cones),
    )
