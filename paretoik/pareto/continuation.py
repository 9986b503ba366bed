"""Follow an optimum while upper bounds move, by quadratic programs.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper(s),  s from 0 to 1

The optimum for the next bounds is predicted from the multipliers and from quadratic models of all objectives, each with
its own Hessian; the active set may change. The error is of third order in the step. Each correction, with the Hessian
of the Lagrangian, squares the error. Source: Guddat, Guerra Vazquez & Jongen 1990, Parametric Optimization, chapter 2;
Diehl, Bock & Schlöder 2005 for predictor steps of Newton's method.
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
    """Tolerances and steps; objectives are divided by their ranges."""

    # largest gradient of the Lagrangian at an optimum, per step of RMS length one, divided by Σ multipliers of F
    residual: float = 1e-8
    violation: float = 1e-9  # largest violation of a constraint at an optimum
    corrections: int = 3  # largest number of corrections; if more are needed, the step is halved
    contraction: float = 0.5  # largest ratio of a correction to the one before; a larger ratio halves the step
    few: int = 1  # largest number of corrections after which the step doubles
    attempts: int = 6  # largest number of steps, failed ones included; after these, solving from a new start is faster
    predictions: int = 3  # largest number of Newton steps of a prediction
    predicted: float = 1e-2  # length of a Newton step, as a share of the whole step, below which it is the last
    updates: int = 2  # number of model updates: one for curved bounds of objectives, one more for curved limits
    # largest excess of a predicted point over a bound or limit, as a share of the step; a larger one halves the step
    missed: float = 0.01
    # largest slacks of an active limit for the first multipliers, tried in order
    active: tuple[float, ...] = (1e-7, 5e-2)
    balance: float = 1e-6  # gradient of the Lagrangian, as a share of the goal's gradient, that ends these trials


OPTIONS = ContinuationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """An optimum, or a guess of it, with its multipliers.

    Multipliers are in this order: limits, the goal's bounds, the program's own bounds.
    """

    x: Point
    multipliers: Float[np.ndarray, " constraints"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Continuation:
    """The last optimum that was followed, with numbers of steps and corrections."""

    optimum: Optimum
    share: float  # share of the way that was followed; if it is below 1, the branch ends or bends back there
    steps: int
    corrections: int


def can_follow(program: Program) -> bool:
    """Return whether optima can be followed: the program must have a kernel and no kinks."""
    return not program.kinked and program.kernel is not None


def guess_optimum(program: Program, x: Point, goal: Goal) -> Optimum | None:
    """Return a point with the multipliers that best balance the goal's gradient.

        minimise    ‖Aᵀy − gradient‖²,  rows of A: gradients of active limits and bounds
        subject to  y ≥ 0

    Returns None if the point is singular or the least squares fail. At a limit that was tightened between samples the
    point has slack; the larger slack in ``OPTIONS.active`` still counts the limit as active.
    """
    from paretoik.nlp.parametric_qp.local_model import first_order  # here: numba

    rows, _ = _bounds(program, goal)
    x = x.copy()  # for read-only or non-contiguous arrays numba would compile again
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
    """Follow the optimum of ``goal(share)`` from share 0 towards 1.

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
    """Return a goal's optimum near a guess, and the number of corrections.

    Returns None if too many corrections are needed. ``kernel`` is the program's kernel if the caller has it already.
    """
    from paretoik.nlp.parametric_qp.predictor_corrector import move_optimum  # here: numba

    kernel = program.kernel if kernel is None else kernel
    x, multipliers, corrections, converged = move_optimum(
        kernel, start.x, start.multipliers, goal.weights, *_bounds(program, goal), _step_options(), False
    )
    return (Optimum(x=program.pin(x[None])[0], multipliers=multipliers), corrections) if converged else None


def predict(program: Program, start: Optimum, goal: Callable[[float], Goal]) -> Point | None:
    """Return the predicted optimum of ``goal(1)`` from that of ``goal(0)``.

    The prediction is not corrected: h(x) = 0 is satisfied exactly, limits and bounds nearly; errors of objectives are
    of fourth order in the step. If the step is too long for the models at the start, it is halved, and new models are
    made on the way. Returns None if no prediction succeeds.
    """
    from paretoik.nlp.parametric_qp.predictor_corrector import move_optimum  # here: numba

    options, optimum, share, step = _step_options(), start, 0.0, 1.0
    for remaining in range(OPTIONS.attempts, 0, -1):
        if share + step * (2**remaining - 1) < 1.0:
            return None
        check_interruption()
        target = min(1.0, share + step)
        wish = goal(target)
        bounds = _bounds(program, wish)
        here = optimum.x, optimum.multipliers
        x, multipliers, _, exists = move_optimum(program.kernel, *here, wish.weights, *bounds, options, True)
        if not exists:  # an excess over a bound or limit is too large a share of the step
            step = (target - share) / 2
            continue
        optimum, share = Optimum(x=program.pin(x[None])[0], multipliers=multipliers), target
        if target == 1.0:
            return optimum.x
    return None


def _step_options() -> Any:
    """Return the settings of compiled code: those of ``OPTIONS``, and the defaults of quadratic programs."""
    from paretoik.nlp.parametric_qp.homotopy import QpOptions  # here: numba
    from paretoik.nlp.parametric_qp.predictor_corrector import StepOptions

    return StepOptions(**{name: getattr(OPTIONS, name) for name in StepOptions._fields if name != "qp"}, qp=QpOptions())


def _bounds(
    program: Program, goal: Goal
) -> tuple[Float[np.ndarray, "bounds objectives"], Float[np.ndarray, " bounds"]]:
    """Return rows and upper bounds: the goal's, then the program's own."""
    finite, bounded = np.isfinite(goal.upper), np.isfinite(program.upper)
    rows = np.concatenate([goal.rows[finite], np.eye(len(program.upper))[bounded]])
    return rows, np.concatenate([goal.upper[finite], program.upper[bounded]])
