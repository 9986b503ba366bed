"""An optimum followed while the upper bounds of its goal move: predicted, then corrected, by quadratic programs.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper(s),  s from 0 to 1

At an optimum with its multipliers the quadratic models of all objectives, each with its own Hessian, predict the
optimum of the bounds that are wanted next up to the cube of the step, constraints added and dropped on the way; each
correction, by the Hessian of the Lagrangian, squares what is left. Source: Guddat, Guerra Vazquez & Jongen 1990,
Parametric Optimization, chapter 2; Diehl, Bock & Schlöder 2005 for predictor steps of Newton's method.
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

    A point is an optimum where the length of the Lagrangian's gradient, of a step of RMS length one and over the sum of
    the objectives' multipliers, is at most ``residual``, and no constraint is violated by more than ``violation``. More
    than so many ``corrections``, or one that is not shorter than the one before by a factor of ``contraction``, halve
    the step, at most ``few`` double it. So many ``attempts`` are made at most, good ones among them: where that is not
    enough, a solver that starts anew is faster. The models predict in so many ``predictions`` of Newton's method, or
    until one is a share ``predicted`` of the whole step. What nothing corrects has its values updated so many times,
    ``updates``: once for curved bounds of objectives, once more for curved limits. If a bound or a
    limit is then exceeded by a share ``missed`` of the step, the models do not reach so far.

    Where multipliers begin: limits with a slack up to one of the ``active`` ones count as active, until the gradient
    of the Lagrangian is at most ``balance``, a share of the objectives'.
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
    """An optimum, or a guess of one, and the multipliers of the limits, then of the goal's and the program's bounds."""

    x: Point
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


def can_follow(program: Program) -> bool:
    """Return whether optima can be followed: by a compiled kernel, and where no kinks make multipliers jump."""
    return not program.kinked and program.kernel is not None


def guess_optimum(program: Program, x: Point, goal: Goal) -> Optimum | None:
    """Return a point with the multipliers that balance the gradients of a goal best; None where none come near.

    Limits that are tightened elsewhere are not active here, although their multipliers are positive.
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
        except RuntimeError:  # no end within its iterations
            return None
        multipliers = np.zeros(len(slacks) + len(rows))
        multipliers[limits] = (solution / lengths)[: len(limits)]
        multipliers[len(slacks) :] = (solution / lengths)[len(limits) :]
        if residual <= OPTIONS.balance * size:
            break
    return Optimum(x=x, multipliers=multipliers)


def follow(program: Program, start: Optimum, goal: Callable[[float], Goal], *, partly: bool = False) -> Continuation:
    """Return how far the optimum of ``goal`` (share) is followed from that at 0, to 1 at most.

    Once the attempts that remain cannot lead to 1 it goes no further, unless ``partly`` will do.
    """
    optimum, share, step, steps, corrections, changes = start, 0.0, 1.0, 0, 0, 0
    kernel = program.kernel
    for remaining in range(OPTIONS.attempts, 0, -1):
        if share >= 1.0 or share + step * (2**remaining - 1) < 1.0:
            break
        check_interruption()
        target = min(1.0, share + step)
        result = _correct(program, kernel, optimum, goal(target))
        if result is None:
            step = (target - share) / 2
            continue
        optimum, count, changed = result
        share, steps, corrections, changes = target, steps + 1, corrections + count, changes + changed
        step *= 2.0 if count <= OPTIONS.few else 1.0
    return Continuation(optimum=optimum, share=share, steps=steps, corrections=corrections, changes=changes)


def correct(program: Program, start: Optimum, goal: Goal) -> Optimum | None:
    """Return the optimum of a goal near a guess; None where few corrections do not lead to it."""
    result = _correct(program, program.kernel, start, goal)
    return None if result is None else result[0]


def predict(program: Program, start: Optimum, goal: Callable[[float], Goal]) -> Point | None:
    """Return the point predicted to be the optimum of ``goal`` (1), from that at 0; None where there is no prediction.

    It is not corrected: h(x) = 0 holds there, limits and bounds nearly, and objectives err by the fourth power of the
    step. Where models at the start do not reach so far, they are made anew on the way, where they predict.
    """
    optimum, share, step = start, 0.0, 1.0
    for remaining in range(OPTIONS.attempts, 0, -1):
        if share + step * (2**remaining - 1) < 1.0:
            return None
        check_interruption()
        target = min(1.0, share + step)
        predicted = _predict(program, optimum, goal(target))
        if predicted is None:
            step = (target - share) / 2
        elif target == 1.0:
            return predicted.x
        else:
            optimum, share = predicted, target
    return None


def _predict(program: Program, start: Optimum, goal: Goal) -> Optimum | None:
    """Return what one model predicts; None where a bound is missed by too large a part of the step."""
    from paretoik.nlp.parametric_qp.prediction import PredictionOptions
    from paretoik.nlp.parametric_qp.prediction import predict as search
    from paretoik.nlp.parametric_qp.solution import QpOptions

    options = PredictionOptions(
        predictions=OPTIONS.predictions,
        predicted=OPTIONS.predicted,
        updates=OPTIONS.updates,
        missed=OPTIONS.missed,
        violation=OPTIONS.violation,
        qp=QpOptions(),
    )
    x, multipliers, exists = search(
        program.kernel, start.x, start.multipliers, goal.weights, *_bounds(program, goal), options
    )
    return Optimum(x=program.pin(x[None])[0], multipliers=multipliers) if exists else None


def _correct(program: Program, kernel: Any, start: Optimum, goal: Goal) -> tuple[Optimum, int, int] | None:
    """Return the optimum of a goal, and how many corrections and changes of the active set led to it."""
    from paretoik.nlp.parametric_qp.correction import CorrectionOptions
    from paretoik.nlp.parametric_qp.correction import correct as search
    from paretoik.nlp.parametric_qp.solution import QpOptions

    options = CorrectionOptions(
        residual=OPTIONS.residual,
        violation=OPTIONS.violation,
        corrections=OPTIONS.corrections,
        contraction=OPTIONS.contraction,
        predictions=OPTIONS.predictions,
        predicted=OPTIONS.predicted,
        qp=QpOptions(),
    )
    x, multipliers, _, corrections, changes, converged = search(
        kernel, start.x, start.multipliers, goal.weights, *_bounds(program, goal), options
    )
    return (Optimum(x=program.pin(x[None])[0], multipliers=multipliers), corrections, changes) if converged else None


def _bounds(
    program: Program, goal: Goal
) -> tuple[Float[np.ndarray, "bounds objectives"], Float[np.ndarray, " bounds"]]:
    """Return the finite rows of the goal, then those of the program's own bounds, and what they may be at most."""
    finite, bounded = np.isfinite(goal.upper), np.isfinite(program.upper)
    rows = np.concatenate([goal.rows[finite], np.eye(len(program.upper))[bounded]])
    return rows, np.concatenate([goal.upper[finite], program.upper[bounded]])
