"""Continuation of an optimum while its goal's upper bounds move, by quadratic programs.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper(s),  s from 0 to 1

At an optimum with its multipliers, quadratic models of all objectives, each with its own Hessian, predict the optimum
for the next bounds, with changes of the active set; the error is of the order of the step's cube. Each correction, with
the Hessian of the Lagrangian, squares the error. Source: Guddat, Guerra Vazquez & Jongen 1990, Parametric Optimization,
chapter 2; Diehl, Bock & Schlöder 2005 for predictor steps of Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from paretoik.arrays import Point
from paretoik.nlp.program import Goal, Program
from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True)
class ContinuationOptions:
    """Tolerances and steps; objectives are divided by their ranges.

    residual: largest gradient of the Lagrangian at an optimum, for a step of RMS length one, over Σ multipliers of F
    violation: largest violation of a constraint at an optimum
    corrections: largest number of corrections; more halve the step
    contraction: largest ratio of a correction to the one before; a larger ratio halves the step
    few: number of corrections up to which the step doubles
    attempts: largest number of attempts, successful ones included; after that a solver from a fresh start is faster
    predictions: largest number of Newton steps of a prediction
    predicted: share of the whole step; a shorter Newton step is the last
    updates: updates of values without correction: one for curved bounds of objectives, one more for curved limits
    missed: share of the step by which a predicted point may exceed a bound or a limit; else the step is too long
    active: slacks up to which limits count as active for the first multipliers, tried in order
    balance: gradient of the Lagrangian, as a share of the objectives', that ends these trials
    """

    residual: float = 1e-8
    violation: float = 1e-9
    corrections: int = 3
    contraction: float = 0.5
    few: int = 1
    attempts: int = 6
    predictions: int = 3
    predicted: float = 1e-2
    updates: int = 2
    missed: float = 0.01
    active: tuple[float, ...] = (1e-7, 5e-2)
    balance: float = 1e-6


OPTIONS = ContinuationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """An optimum or a guess of one; multipliers of limits, then of the goal's and the program's bounds."""

    x: Point
    multipliers: Float[np.ndarray, " constraints"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Continuation:
    """The last optimum that was followed, and the number of steps and of their corrections.

    share: share of the way; below 1 the branch ends or bends back there
    """

    optimum: Optimum
    share: float
    steps: int
    corrections: int


def can_follow(program: Program) -> bool:
    """Return whether optima can be followed: with a compiled kernel and without kinks (multipliers jump)."""
    return not program.kinked and program.kernel is not None


def guess_optimum(program: Program, x: Point, goal: Goal) -> Optimum | None:
    """Return a point with the multipliers y that best balance the goal's gradient; else None.

        minimise    ‖Aᵀy − gradient‖²,  rows of A: gradients of active limits and bounds
        subject to  y ≥ 0

    Limits that are tightened elsewhere are not active here, although their multipliers are positive. None if the point
    is singular or the least squares fail.
    """
    from paretoik.nlp.parametric_qp.local_model import first_order  # here: numba

    rows, _ = _bounds(program, goal)
    _, gradients, slacks, columns, entries, regular = first_order(program.kernel, x, len(program.upper))
    if not regular:
        return None
    gradient = goal.weights @ gradients
    size = max(float(np.linalg.norm(gradient)), 1e-300)
    for tolerance in OPTIONS.active:
        limits = np.flatnonzero(slacks <= tolerance)
        normals = np.zeros((len(limits) + len(rows), len(gradient)))
        np.add.at(normals, (np.arange(len(limits))[:, None], columns[limits]), entries[limits])
        normals[len(limits) :] = -rows @ gradients
        lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        try:
            solution, residual = nnls((normals / lengths[:, None]).T, gradient)
        except RuntimeError:  # iteration limit reached
            return None
        multipliers = np.zeros(len(slacks) + len(rows))
        multipliers[limits] = (solution / lengths)[: len(limits)]
        multipliers[len(slacks) :] = (solution / lengths)[len(limits) :]
        if residual <= OPTIONS.balance * size:
            break
    return Optimum(x=x, multipliers=multipliers)


def follow(program: Program, start: Optimum, goal: Callable[[float], Goal]) -> Continuation:
    """Return how far the optimum of ``goal(share)`` is followed from share 0, to 1 at most.

    It stops as soon as the remaining attempts cannot reach 1.
    """
    optimum, share, step, steps, corrections = start, 0.0, 1.0, 0, 0
    kernel = program.kernel
    for remaining in range(OPTIONS.attempts, 0, -1):
        if share >= 1.0 or share + step * (2**remaining - 1) < 1.0:
            break
        check_interruption()
        target = min(1.0, share + step)
        result = correct(program, optimum, goal(target), kernel)
        if result is None:
            step = (target - share) / 2
            continue
        optimum, count = result
        share, steps, corrections = target, steps + 1, corrections + count
        step *= 2.0 if count <= OPTIONS.few else 1.0
    return Continuation(optimum=optimum, share=share, steps=steps, corrections=corrections)


def correct(program: Program, start: Optimum, goal: Goal, kernel: Any = None) -> tuple[Optimum, int] | None:
    """Return the optimum of a goal near a guess, and the number of corrections; None if they do not reach it.

    ``kernel`` is the program's, if it is there already.
    """
    from paretoik.nlp.parametric_qp.correction import CorrectionOptions
    from paretoik.nlp.parametric_qp.correction import correct as search

    options = _compiled_options(CorrectionOptions)
    kernel = program.kernel if kernel is None else kernel
    x, multipliers, _, corrections, _, converged = search(
        kernel, start.x, start.multipliers, goal.weights, *_bounds(program, goal), options
    )
    return (Optimum(x=program.pin(x[None])[0], multipliers=multipliers), corrections) if converged else None


def predict(program: Program, start: Optimum, goal: Callable[[float], Goal]) -> Point | None:
    """Return the predicted optimum of ``goal(1)`` from that of ``goal(0)``; None if there is no prediction.

    It is not corrected: the point satisfies h(x) = 0 exactly and limits and bounds nearly; errors of objectives are of
    the fourth power of the step. If the models at the start do not reach far enough, new models are made on the way.
    """
    from paretoik.nlp.parametric_qp.prediction import PredictionOptions
    from paretoik.nlp.parametric_qp.prediction import predict as search

    options, optimum, share, step = _compiled_options(PredictionOptions), start, 0.0, 1.0
    for remaining in range(OPTIONS.attempts, 0, -1):
        if share + step * (2**remaining - 1) < 1.0:
            return None
        check_interruption()
        target = min(1.0, share + step)
        wish = goal(target)
        bounds = _bounds(program, wish)
        x, multipliers, exists = search(program.kernel, optimum.x, optimum.multipliers, wish.weights, *bounds, options)
        if not exists:  # a bound is exceeded by too large a share of the step
            step = (target - share) / 2
            continue
        optimum, share = Optimum(x=program.pin(x[None])[0], multipliers=multipliers), target
        if target == 1.0:
            return optimum.x
    return None


def _compiled_options(kind: type[Any]) -> Any:
    """Return the settings of compiled code, a named tuple: ours by name, and ``qp``."""
    from paretoik.nlp.parametric_qp.homotopy import QpOptions

    return kind(**{name: getattr(OPTIONS, name) for name in kind._fields if name != "qp"}, qp=QpOptions())


def _bounds(
    program: Program, goal: Goal
) -> tuple[Float[np.ndarray, "bounds objectives"], Float[np.ndarray, " bounds"]]:
    """Return the finite rows of the goal, then those of the program's own bounds, and their upper bounds."""
    finite, bounded = np.isfinite(goal.upper), np.isfinite(program.upper)
    rows = np.concatenate([goal.rows[finite], np.eye(len(program.upper))[bounded]])
    return rows, np.concatenate([goal.upper[finite], program.upper[bounded]])
