"""Least kinetic energy by the calculus of variations: motions along which ∫ ½ q̇ᵀ M q̇ dt is stationary.

Under the path's constraint J q̇ = ẋ the Euler–Lagrange equation is M q̈ + n = Jᵀλ, with n(q, q̇) the Coriolis and
centrifugal torques: no torque drives the self-motion. Without λ: q̈ = J_B⁺(ẍ − J̇q̇) − (I − J_B⁺J) M⁻¹n, J_B⁺ weighted
by the inertia. Tringali & Cocuzza 2020, Eq. 20, has the opposite sign, along which nothing is stationary. Where an
end is free, no momentum is left in the self-motion (transversality), which is q̇ = J_B⁺ẋ.

Source: Nedungadi & Kazerounian 1989, A local solution with global characteristics for the joint torque optimization
of a redundant manipulator; Gelfand & Fomin 1963, Calculus of Variations, chapter 5 (Jacobi's condition).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.resolution.equation_of_motion import EquationOfMotion, equation_of_motion
from paretoik.resolution.integration import integrate
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import START_TOLERANCE
from paretoik.task.retraction import retract, row_space_basis, task_errors


def extremal_paths(
    task: MotionTask, start: Float[np.ndarray, "motions dof"], *, tolerance: Float[np.ndarray, " motions"]
) -> tuple[Float[np.ndarray, "motions time dof"], Float[np.ndarray, "motions time dof"]]:
    """Return positions and velocities of stationary kinetic energy, NaN from where a motion runs into a singularity.

    Raises InvalidInput for a cyclic task, a massless arm, starts off the path and tolerances out of range.
    """
    check_tolerance(tolerance)
    equation = equation_of_motion(task)
    q = starts_on_path(task, start)
    return integrate_paths(equation, q, equation.initial_rates(q), tolerance)


def retract_nearest(task: MotionTask, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return postures near the path retracted onto it the shortest way; those that don't arrive are NaN."""
    jacobians = task_errors(task.arm, task.tasks, q, targets)[1]
    result = retract(task.arm, task.tasks, q, targets, row_space_basis(jacobians))
    return np.where(result.on_path[:, None], result.q, np.nan)


def check_tolerance(tolerance: float | np.ndarray) -> None:
    """Raise InvalidInput for a tolerance out of range."""
    lowest, highest = 1e-13, 1e-3  # finer ones are below rounding, coarser ones leave the path
    for value in np.ravel(tolerance):
        if not lowest <= value <= highest:
            raise InvalidInput(f"variational: tolerance must be {lowest:g} to {highest:g}, got {value:g}")


def starts_on_path(task: MotionTask, start: np.ndarray | None) -> np.ndarray:
    """Return postures (*batch, dof) on the path's first sample; raise InvalidInput where they are not."""
    q = task.start if start is None else np.asarray(start, dtype=float)
    if q is None:
        raise InvalidInput("variational: wants start postures, the task has no start of its own")
    if q.ndim == 0 or q.shape[-1] != task.arm.dof or not np.isfinite(q).all():
        raise InvalidInput(f"variational: start wants finite postures (..., {task.arm.dof}), got shape {q.shape}")
    flat = q.reshape(-1, task.arm.dof)
    targets = np.tile(task.targets[0], (len(flat), 1))
    distance = np.abs(task_errors(task.arm, task.tasks, flat, targets)[0]).max(axis=0, initial=0.0)
    if (distance > START_TOLERANCE).any():
        worst = int(np.argmax(distance))
        raise InvalidInput(
            f"variational: start {worst} is {distance[worst]:.3g} m (or rad) off the path's first sample; wants at "
            f"most {START_TOLERANCE}"
        )
    retracted = retract_nearest(task, flat, targets)
    return np.where(np.isfinite(retracted), retracted, flat).reshape(q.shape)


def integrate_paths(
    equation: EquationOfMotion, q: np.ndarray, dq: np.ndarray, tolerance: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (motions, time, dof), retracted onto the path sample by sample."""
    task, count = equation.task, len(q)
    states = integrate(equation, np.concatenate([q, dq], axis=1), task.times, tolerance)
    near, rates = (part.reshape(-1, task.arm.dof) for part in np.split(states, 2, axis=2))
    with np.errstate(invalid="ignore"):
        paths = retract_nearest(task, near, np.tile(task.targets, (count, 1)))
    return paths.reshape(count, -1, task.arm.dof), _project_rates(equation, paths, rates, count)


def _project_rates(equation: EquationOfMotion, paths: np.ndarray, rates: np.ndarray, count: int) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        projected = equation.project(np.tile(equation.task.times, count), paths, rates)
    return projected.reshape(count, -1, paths.shape[1])
