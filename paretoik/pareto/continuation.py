"""An optimum followed while the upper bounds of its goal move: predicted, then corrected, by one quadratic program.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper(s),  s from 0 to 1

At an optimum with its multipliers the quadratic program has the Hessian of the Lagrangian and the bounds that are
wanted next; its solution, constraints added and dropped on the way, is the optimum there up to the square of the step,
and so is each correction's. Source: Guddat, Guerra Vazquez & Jongen 1990, Parametric Optimization, chapter 2; Diehl,
Bock & Schlöder 2005 for the predictor that is a full step of Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.nlp.conic import Constraints
from paretoik.nlp.parametric_qp import solve_from
from paretoik.nlp.program import Goal, Linearisation, Program, bounded
from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True)
class ContinuationOptions:
    """Tolerances and steps; objectives are divided by their ranges.

    A point is an optimum where the length of the Lagrangian's gradient, of a step of RMS length one and over the sum of
    the objectives' multipliers, is at most ``residual``, and no constraint is violated by more than ``violation``. More
    than so many ``corrections``, or one that is not shorter than the one before by a factor of ``contraction``, halve
    the step, at most ``few`` double it. So many ``attempts`` are made at most, good ones among them: where that is not
    enough, a solver that starts anew is faster.

    Where multipliers begin: limits with a slack up to one of the ``active`` ones count as active, until the gradient
    of the Lagrangian is at most ``balance``, a share of the objectives'.
    """

    residual: float = 1e-8
    violation: float = 1e-9
    corrections: int = 3
    contraction: float = 0.5
    few: int = 1
    attempts: int = 6
    active: tuple[float, ...] = (1e-7, 5e-2)
    balance: float = 1e-6


OPTIONS = ContinuationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """An optimum, or a guess of one: the program to first order there, and the multipliers of all constraints.

    Constraints are the inequalities and, after the elastic ones, the bounds of the goal and the program.
    """

    at: Linearisation
    multipliers: Float[np.ndarray, " constraints"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Continuation:
    """How far an optimum was followed: where it is, the ``share`` of the way, and what that took.

    ``corrections`` are those of all ``steps``; a share below 1 says that its branch ends, or bends back, there.
    """

    optimum: Optimum
    share: float
    steps: int
    corrections: int
    changes: int


def can_follow(at: Linearisation) -> bool:
    """Return whether optima can be followed: where there are kinks multipliers jump, and auxiliary columns are many."""
    return at.columns == at.unknowns and not at.cones


def guess_optimum(program: Program, at: Linearisation, goal: Goal) -> Optimum | None:
    """Return a point with the multipliers that balance the gradients of a goal best; None where none come near.

    Limits that are tightened elsewhere are not active here, although their multipliers are positive.
    """
    constraints, elastic = _constraints(program, at, goal)
    first, count = elastic - len(_all_rows(program, goal)), len(constraints.values)
    gradient = goal.weights @ at.gradients
    size = max(float(np.linalg.norm(gradient)), 1e-300)
    bounds = np.arange(first, elastic)
    for tolerance in OPTIONS.active:
        limits = np.flatnonzero(constraints.values <= tolerance)
        rows = np.concatenate([limits[(limits < first) | (limits >= elastic)], bounds])
        normals = constraints.jacobian[rows].toarray() / constraints.row_norms[rows, None]
        try:
            solution, residual = nnls(normals.T, gradient)
        except RuntimeError:  # no end within its iterations
            return None
        multipliers = np.zeros(count)
        multipliers[rows] = solution / constraints.row_norms[rows]
        if residual <= OPTIONS.balance * size:
            break
    return Optimum(at=at, multipliers=multipliers)


def follow(program: Program, start: Optimum, goal: Callable[[float], Goal]) -> Continuation:
    """Return how far the optimum of ``goal`` (share) is followed from that at 0, to 1 at most."""
    optimum, share, step, steps, corrections, changes = start, 0.0, 1.0, 0, 0, 0
    for _ in range(OPTIONS.attempts):
        if share >= 1.0:
            break
        check_interruption()
        target = min(1.0, share + step)
        result = _correct(program, optimum, goal(target))
        if result is None:
            step = (target - share) / 2
            continue
        optimum, used, changed = result
        share, steps, corrections, changes = target, steps + 1, corrections + used, changes + changed
        step *= 2.0 if used <= OPTIONS.few else 1.0
    return Continuation(optimum=optimum, share=share, steps=steps, corrections=corrections, changes=changes)


def correct(program: Program, start: Optimum, goal: Goal) -> Optimum | None:
    """Return the optimum of a goal near a guess; None where few corrections do not lead to it."""
    result = _correct(program, start, goal)
    return None if result is None else result[0]


def residual_at(program: Program, optimum: Optimum, goal: Goal) -> tuple[float, float]:
    """Return the length of the Lagrangian's gradient, and the worst violation of constraints and complementarity."""
    return _residual(optimum.at, *_constraints(program, optimum.at, goal), optimum.multipliers, program, goal)


def _correct(program: Program, start: Optimum, goal: Goal) -> tuple[Optimum, int, int] | None:
    """Return the optimum of a goal, and how many corrections and changes of the active set led to it."""
    at, multipliers, changes, before = start.at, start.multipliers, 0, np.inf
    constraints, elastic = _constraints(program, at, goal)
    for used in range(OPTIONS.corrections + 1):
        solution = solve_from(
            _hessian(program, at, goal, multipliers, elastic),
            goal.weights @ at.gradients,
            constraints.jacobian,
            constraints.values,
            multipliers,
        )
        changes += solution.changes
        length = float(np.abs(solution.step).max(initial=0.0))
        if solution.share < 1.0 or length > OPTIONS.contraction * before:
            return None
        before = length
        x = at.retract(solution.step)
        if x is None:
            return None
        try:
            at, multipliers = program.linearise(x), solution.multipliers
        except (EvaluationFailed, SolverFailed, np.linalg.LinAlgError):
            return None
        constraints, elastic = _constraints(program, at, goal)
        stationarity, violation = _residual(at, constraints, elastic, multipliers, program, goal)
        if stationarity <= OPTIONS.residual and violation <= OPTIONS.violation:
            return Optimum(at=at, multipliers=multipliers), used, changes
    return None


def _constraints(program: Program, at: Linearisation, goal: Goal) -> tuple[Constraints, int]:
    """Return the inequalities to first order, and where the last bound of the goal and the program stands."""
    rows, finite = _all_rows(program, goal), np.isfinite(program.upper)
    upper = np.concatenate([goal.upper[np.isfinite(goal.upper)], program.upper[finite]])
    return bounded(at, Goal(weights=goal.weights, rows=rows, upper=upper))


def _all_rows(program: Program, goal: Goal) -> Float[np.ndarray, "bounds objectives"]:
    """Return the finite rows of the goal, then those of the program's own bounds."""
    own = np.eye(len(program.upper))[np.isfinite(program.upper)]
    return np.concatenate([goal.rows[np.isfinite(goal.upper)], own])


def _objective_weights(
    program: Program, goal: Goal, multipliers: np.ndarray, elastic: int
) -> Float[np.ndarray, " objectives"]:
    rows = _all_rows(program, goal)
    return np.asarray(goal.weights + multipliers[elastic - len(rows) : elastic] @ rows)


def _hessian(
    program: Program, at: Linearisation, goal: Goal, multipliers: np.ndarray, elastic: int
) -> Float[np.ndarray, "columns columns"]:
    """Return the Hessian of the Lagrangian."""
    bounds = len(_all_rows(program, goal))
    inequalities = np.concatenate([multipliers[: elastic - bounds], multipliers[elastic:]])
    weights = _objective_weights(program, goal, multipliers, elastic)
    return np.asarray(at.hessian(weights, inequalities, ()).toarray())


def _residual(
    at: Linearisation,
    constraints: Constraints,
    elastic: int,
    multipliers: np.ndarray,
    program: Program,
    goal: Goal,
) -> tuple[float, float]:
    gradient = goal.weights @ at.gradients - constraints.jacobian.T @ multipliers
    total = max(1.0, float(np.abs(_objective_weights(program, goal, multipliers, elastic)).sum()))
    off = np.abs(constraints.values[multipliers > 0]).max(initial=0.0)
    violation = max(float(off), -float(constraints.values.min(initial=0.0)))
    return float(np.linalg.norm(gradient)) * at.unit / total, violation
