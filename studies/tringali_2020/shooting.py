"""Motions of stationary kinetic energy with both ends free, by shooting: Newton's method on the first posture.

Source: Gelfand & Fomin 1963, Calculus of Variations, sections 14 (transversality) and 26 to 29 (Jacobi's condition).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.variational import (
    EquationOfMotion,
    check_tolerance,
    equation_of_motion,
    integrate,
    starts_on_path,
)
from paretoik.robot import dynamics
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest, task_errors
from paretoik.task.self_motion import build_charts
from studies.tringali_2020.extremals import Extremal, follow_equation


@dataclass(frozen=True, kw_only=True)
class ShootingOptions:
    """Settings of Newton's method on the posture at sample 0."""

    iterations: int = 20
    difference: float = 1e-4  # rad or m: of the finite differences
    rank_tolerance: float = 1e-4  # share of the largest singular value: smaller ones are below the differences' error
    longest_step: float = 0.2  # rad or m along the self-motion
    shortest_step: float = 1e-3  # rad or m: a search with shorter steps is stopped
    residual: float = 1e3  # times the step tolerance: rad/s or m/s of self-motion left at a free end
    distinct: float = 1e-4  # rad or m: motions with nearer starts are the same


OPTIONS = ShootingOptions()


def shoot_extremals(task: MotionTask, starts: Float[np.ndarray, "*batch dof"], *, tolerance: float = 1e-8) -> Extremal:
    """Return the distinct motions of stationary kinetic energy with both ends free, by Newton's method from postures.

    It looks for the posture at sample 0 from which no momentum is left in the self-motion at the end. The motions
    (motions, time, dof) are sorted by energy, least first; ``minimum`` says which are local minima; the others are
    saddles. Starts whose motions meet a singularity, or from which Newton's method does not converge, are left out.

    Raises InvalidInput as ``integrate_extremal`` does and for a task with a start of its own, Infeasible if there is no
    such motion.
    """
    if task.start is not None:
        raise InvalidInput("shooting: start must be free, got a task with its own start; integrate_extremal takes it")
    check_tolerance(tolerance)
    equation = equation_of_motion(task)
    q = _transversal_postures(equation, starts_on_path(task, starts).reshape(-1, task.arm.dof), tolerance)
    if len(q) == 0:
        raise Infeasible("shooting: no start led to a motion that leaves no momentum in the self-motion at its end")
    extremals = follow_equation(equation, q, equation.initial_rates(q), tolerance, q.shape[:1])
    index = np.array(_distinct(task, q, extremals.energy))
    motion, dq = extremals.motion[index], extremals.dq[index]
    return replace(extremals, motion=motion, dq=dq, minimum=_is_minimum(equation, motion.q, tolerance))


def _transversal_postures(equation: EquationOfMotion, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Return postures (motions, dof) at sample 0 from which no self-motion velocity is left at the end."""
    task, dof = equation.task, q.shape[1]
    best, step = np.full(len(q), np.inf), np.zeros_like(q)
    accuracy = OPTIONS.residual * tolerance
    converged = []
    for _ in range(OPTIONS.iterations):
        retraction = retract_nearest(task.arm, task.tasks, q + step, task.targets[0])
        trial = np.where(retraction.on_path[:, None], retraction.q, q)
        near = _neighbours(task, trial, normal := _self_motion_basis(task, trial))
        residual = _end_residual(equation, near.reshape(-1, dof), tolerance).reshape(near.shape)
        size = np.abs(residual[:, 0]).max(axis=1)
        converged.append(trial[size <= accuracy])
        better = (size < best) & np.isfinite(residual).all(axis=(1, 2))
        jacobian = np.swapaxes(residual[better, 1:] - residual[better, :1], 1, 2) / OPTIONS.difference
        step /= 4  # where the last one did not improve
        inverse = np.linalg.pinv(jacobian, rcond=OPTIONS.rank_tolerance)
        step[better] = -(normal[better] @ inverse @ residual[better, 0, :, None])[..., 0]
        step /= np.maximum(1.0, np.linalg.norm(step, axis=1, keepdims=True) / OPTIONS.longest_step)
        q, best = np.where(better[:, None], trial, q), np.where(better, size, best)
        active = (best > accuracy) & (better | (np.abs(step).max(axis=1) > OPTIONS.shortest_step))
        q, best, step = q[active], best[active], step[active]
        if len(q) == 0:
            break
    return np.concatenate(converged)


def _end_residual(equation: EquationOfMotion, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the self-motion velocity (motions, dof) at the end of motions from postures; NaN where they stop early."""
    times = equation.task.times[[0, -1]]
    states = integrate(equation, np.concatenate([q, equation.initial_rates(q)], axis=1), times, tolerance)
    return _self_motion_velocity(equation, states[:, -1])


def _self_motion_velocity(equation: EquationOfMotion, last: np.ndarray) -> np.ndarray:
    """Return the velocity of final states (motions, 2 dof) in excess of the least for the path."""
    q, dq = np.split(last, 2, axis=1)
    with np.errstate(invalid="ignore"):
        path_velocity = equation.project(np.full(len(q), equation.task.times[-1]), q, np.zeros_like(dq))
    return dq - path_velocity


def _self_motion_basis(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (motions, dof, redundancy) of the self-motion at sample 0."""
    jacobian = task_errors(task.arm, task.tasks, q, task.targets[0])[1]
    return np.linalg.svd(jacobian)[2][:, task.rows :].swapaxes(1, 2)


def _neighbours(task: MotionTask, q: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return postures (motions, 1 + redundancy, dof): each itself, and moved along every direction of ``normal``."""
    moves = np.concatenate([np.zeros_like(q)[:, None], np.swapaxes(normal, 1, 2)], axis=1)
    retraction = retract_nearest(task.arm, task.tasks, q[:, None] + OPTIONS.difference * moves, task.targets[0])
    return np.where(retraction.on_path[..., None], retraction.q, np.nan)


def _distinct(task: MotionTask, q: np.ndarray, energy: np.ndarray) -> list[int]:
    """Return the indices of distinct postures, modulo whole turns, least energy first."""
    distinct: list[int] = []
    for i in np.argsort(energy, kind="stable").tolist():
        distance = q[distinct] - q[i]
        distance = np.where(task.arm.periodic, (distance + np.pi) % (2 * np.pi) - np.pi, distance)
        if not (np.abs(distance).max(axis=1, initial=0.0) < OPTIONS.distinct).any():
            distinct.append(i)
    return distinct


def _is_minimum(
    equation: EquationOfMotion, q: Float[np.ndarray, "motions time dof"], tolerance: float
) -> Bool[np.ndarray, " motions"]:
    """Return which motions satisfy Jacobi's condition, by neighbouring motions with free starts.

    The neighbours must not meet a motion before its end, and must arrive there with momentum away from it.
    """
    task, (count, samples, dof) = equation.task, q.shape
    normal = build_charts(task, q).null_space
    near = _neighbours(task, q[:, 0], normal[:, 0]).reshape(-1, dof)
    states = integrate(equation, np.concatenate([near, equation.initial_rates(near)], axis=1), task.times, tolerance)
    paths = states[..., :dof].reshape(count, -1, samples, dof)
    residual = _self_motion_velocity(equation, states[:, -1]).reshape(count, -1, dof)
    fields = np.einsum("mtdk,mrtd->mtkr", normal, paths[:, 1:] - paths[:, :1]) / OPTIONS.difference  # Jacobi fields
    momentum = np.swapaxes(residual[:, 1:] - residual[:, :1], 1, 2) / OPTIONS.difference
    inertia = dynamics.inertia_matrix(task.arm, q[:, -1])
    hessian = np.swapaxes(normal[:, -1] @ fields[:, -1], 1, 2) @ inertia @ momentum
    no_conjugate_point = (np.linalg.det(fields) > 0).all(axis=1)
    symmetric = np.nan_to_num(hessian + np.swapaxes(hessian, 1, 2))
    positive: np.ndarray = np.linalg.eigvalsh(symmetric).min(axis=1) > 0
    return no_conjugate_point & positive
