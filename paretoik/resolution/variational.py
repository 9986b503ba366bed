"""Motions along which ∫ ½ q̇ᵀ M q̇ dt is stationary, by the calculus of variations.

Under the path's constraint J q̇ = ẋ the Euler–Lagrange equation is M q̈ + n = Jᵀλ, with n(q, q̇) the Coriolis and
centrifugal torques: no torque drives the self-motion. Without λ: q̈ = J_B⁺(ẍ − J̇q̇) − (I − J_B⁺J) M⁻¹n, J_B⁺ weighted
by the inertia. Tringali & Cocuzza 2020, Eq. 20, has the opposite sign, which makes nothing stationary. At a free end
no momentum is left in the self-motion (transversality), which means q̇ = J_B⁺ẋ.

Source: Nedungadi & Kazerounian 1989, A local solution with global characteristics for the joint torque optimization
of a redundant manipulator; Gelfand & Fomin 1963, Calculus of Variations, chapter 5 (Jacobi's condition).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.integrate import RK45
from scipy.interpolate import make_interp_spline

from paretoik.arrays import JointPaths
from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.opcodes import Op
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.errors import InvalidInput
from paretoik.robot import dynamics
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest, task_errors
from paretoik.task.task import describe_errors, error_unit, path_equations, path_targets
from paretoik.task.validation import START_TOLERANCE

# The equation of motion of least kinetic energy on a path, M q̈ + n = Jᵀλ with J q̇ = ẋ


@dataclass(frozen=True, kw_only=True)
class ExtremalOptions:
    """Settings of the equation of motion, and of its integration's step size control."""

    knots: int = 2000  # number of knots of the splines through the targets, for time derivatives
    massless: float = 1e-12  # ratio of the inertia matrix's eigenvalues below which a joint moves no mass
    first_step: float = 1e-2  # share of the duration
    shortest_step: float = 1e-5  # share of the duration: shorter steps mean a singularity
    safety: float = 0.9  # factor of the step length that the error estimate allows (Hairer et al. 1993, section II.4)
    smallest_change: float = 0.2  # smallest factor of the step length from one step to the next
    largest_change: float = 5.0


OPTIONS = ExtremalOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """Terms at one instant: J, required J q̇ and J q̈, M, n(q, q̇)."""

    jacobian: Float[np.ndarray, "motions rows dof"]
    velocity: Float[np.ndarray, "motions rows"]
    acceleration: Float[np.ndarray, "motions rows"]
    inertia: Float[np.ndarray, "motions dof dof"]
    torque: Float[np.ndarray, "motions dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class EquationOfMotion:
    """The equation M q̈ + n = Jᵀλ with J q̇ = ẋ.

    targets: splines of the targets and of their two time derivatives
    sign: sign of n, −1; Tringali & Cocuzza 2020, Eq. 20, has 1
    program: evaluator of ``Terms``
    """

    task: MotionTask
    targets: tuple[Any, Any, Any]
    sign: float
    program: Evaluator

    def __call__(self, t: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the rates of states (motions, 2 dof): velocities and accelerations."""
        q, dq = np.split(state, 2, axis=1)
        terms = self.terms(t, q, dq)
        return np.concatenate([dq, _solve_kkt(terms, self.sign * terms.torque, terms.acceleration)], axis=1)

    def initial_rates(self, q: np.ndarray) -> np.ndarray:
        """Return the velocities J_B⁺ẋ (motions, dof) of least kinetic energy at sample 0."""
        return self.project(np.zeros(len(q)), q, np.zeros_like(q))

    def project(self, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Return the velocities on the path nearest to dq, in the metric of the inertia."""
        terms = self.terms(t, q, dq)
        return _solve_kkt(terms, (terms.inertia @ dq[..., None])[..., 0], terms.velocity)

    def terms(self, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> Terms:
        """Return the terms at times t (motions,), postures and velocities (motions, dof)."""
        rows, dof = self.task.rows, self.task.arm.dof
        values = self.program(np.concatenate([q, dq, *(spline(t) for spline in self.targets)], axis=1).T).T
        ends = np.cumsum([rows * dof, rows, rows, dof * dof])
        jacobian, velocity, acceleration, inertia, torque = np.split(values, ends, axis=1)
        return Terms(
            jacobian=jacobian.reshape(-1, rows, dof),
            velocity=velocity,
            acceleration=acceleration,
            inertia=inertia.reshape(-1, dof, dof),
            torque=torque,
        )


def equation_of_motion(task: MotionTask) -> EquationOfMotion:
    """Return a task's equation of motion; raises InvalidInput for a cyclic task, and joints that move no mass."""
    if task.cyclic:
        raise InvalidInput("variational: motion must be open, got a cyclic one")
    inertia = dynamics.inertia_matrix(task.arm, np.full((1, task.arm.dof), 0.5))[0]
    smallest, largest = np.linalg.eigvalsh(inertia)[[0, -1]]
    if smallest <= OPTIONS.massless * largest:
        raise InvalidInput(f"variational: every joint of the arm must move a mass, got {task.arm.name}")
    parts = max(1, -(-OPTIONS.knots // (len(task.times) - 1)))
    knots = np.interp(np.arange(parts * (len(task.times) - 1) + 1) / parts, np.arange(len(task.times)), task.times)
    spline = make_interp_spline(knots, path_targets(task.tasks, knots), k=5)
    # The program of ``Terms``, of q, q̇, and the targets with two time derivatives. The path equations h(q, x) = 0 are
    # satisfied along the path: J q̇ + ∂h/∂x ẋ = 0, and its time derivative too.
    arm = task.arm.mounted(gravity=(0.0, 0.0, 0.0))
    tape, dof, numbers = Tape(), arm.dof, task.targets.shape[1]
    inputs: list[Any] = [[tape.input() for _ in range(count)] for count in (dof, dof, numbers, numbers, numbers)]
    q, dq, *targets = inputs
    equations = [as_entry(tape, value) for value in path_equations(arm, task.tasks, q, targets[0])]
    q_index, dq_index = ([value.index for value in values] for values in (q, dq))
    x_index, dx_index, ddx_index = ([value.index for value in values] for values in targets)
    jacobian = [slope for equation in equations for slope in gradient(tape, equation, q_index)]
    drift = tangents(tape, equations, dict(zip(x_index, dx_index, strict=True)))  # ∂h/∂x ẋ
    direction = dict(zip([*q_index, *x_index], [*dq_index, *dx_index], strict=True))
    first_rate = tangents(tape, equations, direction)
    second_rate = tangents(tape, first_rate, direction | dict(zip(dx_index, ddx_index, strict=True)))
    zero, units = [0.0] * dof, np.eye(dof).tolist()
    inertia = [dynamics.torque_components(arm, q, zero, unit) for unit in units]
    torque = dynamics.torque_components(arm, q, dq, zero)
    forces = [as_entry(tape, value) for value in (*(value for column in inertia for value in column), *torque)]
    negated = [tape.apply(Op.NEGATE, value) for value in (*drift, *second_rate)]
    return EquationOfMotion(
        task=task,
        targets=(spline, spline.derivative(), spline.derivative(2)),
        sign=-1.0,
        program=compile_evaluator(tape, [*jacobian, *negated, *forces]),
    )


def _solve_kkt(terms: Terms, force: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return x = J_B⁺ rates + (I − J_B⁺J) M⁻¹ force, with J x = ``rates``, M x = ``force`` + Jᵀλ; NaN if singular."""
    rows, dof = terms.jacobian.shape[1:]
    matrix = np.zeros((len(rates), dof + rows, dof + rows))
    matrix[:, :dof, :dof], matrix[:, dof:, :dof] = terms.inertia, terms.jacobian
    matrix[:, :dof, dof:] = np.swapaxes(terms.jacobian, 1, 2)
    matrix[np.linalg.det(matrix) == 0] = np.nan
    right = np.concatenate([force, rates], axis=1)[..., None]
    solution: np.ndarray = np.linalg.solve(matrix, right)[:, :dof, 0]
    return solution


# Motions of least kinetic energy, by integration.


def extremal_paths(
    task: MotionTask, start: Float[np.ndarray, "motions dof"], *, tolerance: Float[np.ndarray, " motions"]
) -> tuple[JointPaths, JointPaths]:
    """Return positions and velocities of stationary kinetic energy, NaN after a singularity.

    Raises InvalidInput for a cyclic task, a massless arm, starts off the path and tolerances out of range.
    """
    check_tolerance(tolerance)
    equation = equation_of_motion(task)
    q = starts_on_path(task, start)
    return integrate_paths(equation, q, equation.initial_rates(q), tolerance)


def check_tolerance(tolerance: float | np.ndarray) -> None:
    """Raise InvalidInput for a tolerance out of range."""
    lowest, highest = 1e-13, 1e-3  # below 1e-13 rounding is larger, above 1e-3 motions leave the path
    for value in np.ravel(tolerance):
        if not lowest <= value <= highest:
            raise InvalidInput(f"variational: tolerance must be from {lowest:g} to {highest:g}, got {value:g}")


def starts_on_path(task: MotionTask, start: np.ndarray | None) -> np.ndarray:
    """Return postures (*batch, dof) on the path's first sample; raises InvalidInput for others."""
    q = task.start if start is None else np.asarray(start, dtype=float)
    if q is None:
        raise InvalidInput("variational: start must be postures, got none, and the task has no start of its own")
    if q.ndim == 0 or q.shape[-1] != task.arm.dof or not np.isfinite(q).all():
        raise InvalidInput(f"variational: start must be finite postures (..., {task.arm.dof}), got shape {q.shape}")
    errors = np.abs(task_errors(task.arm, task.tasks, q, task.targets[0])[0]).reshape(-1, task.rows)
    distance = errors.max(axis=1, initial=0.0)
    if (distance > START_TOLERANCE).any():
        worst = int(np.argmax(distance))
        raise InvalidInput(
            f"variational: start {worst} must be at most {START_TOLERANCE} {error_unit(task.tasks)} off the path's "
            f"first sample, got {describe_errors(task.tasks, errors[worst])}"
        )
    retraction = retract_nearest(task.arm, task.tasks, q, task.targets[0])
    return np.where(retraction.on_path[..., None], retraction.q, q)


def integrate_paths(
    equation: EquationOfMotion, q: np.ndarray, dq: np.ndarray, tolerance: float | np.ndarray
) -> tuple[JointPaths, JointPaths]:
    """Return positions and velocities (motions, time, dof), every sample retracted onto the path."""
    task = equation.task
    states = integrate(equation, np.concatenate([q, dq], axis=1), task.times, tolerance)
    near, rates = np.split(states, 2, axis=2)
    with np.errstate(invalid="ignore"):
        retraction = retract_nearest(task.arm, task.tasks, near, task.targets)
        paths = np.where(retraction.on_path[..., None], retraction.q, np.nan)
        times, flat = np.tile(task.times, len(q)), (-1, task.arm.dof)
        projected = equation.project(times, paths.reshape(flat), rates.reshape(flat))
    return paths, projected.reshape(paths.shape)


def integrate(
    equation: EquationOfMotion,
    start: Float[np.ndarray, "motions state"],
    times: Float[np.ndarray, " time"],
    tolerance: float | Float[np.ndarray, " motions"],
) -> Float[np.ndarray, "motions time state"]:
    """Return states at ``times``, NaN from the first time that a motion does not reach.

    tolerance: error of positions and velocities in every step, relative if these are larger than 1
    """
    states = np.full((len(start), len(times), start.shape[1]), np.nan)
    duration = times[-1] - times[0]
    allowed = np.broadcast_to(np.asarray(tolerance, dtype=float), (len(start),))
    t, y = np.full(len(start), times[0]), start.copy()
    length = np.full(len(start), OPTIONS.first_step * duration)
    with np.errstate(all="ignore"):  # near a singularity numbers overflow, and shorter steps are tried
        rate = equation(t, y)
        for sample, end in enumerate(times):
            while len(active := np.flatnonzero((t < end) & (length > OPTIONS.shortest_step * duration))):
                remaining = end - t[active]
                step = np.minimum(length[active], remaining)
                # One step of each motion, and its error in shares of the tolerance. Source: Dormand & Prince 1980.
                before, h, stages = y[active], step[:, None], [rate[active]]
                for row, share in zip(RK45.A[1:], RK45.C[1:], strict=True):
                    stages.append(equation(t[active] + share * step, before + h * _combine(row, stages)))
                trial = before + h * _combine(RK45.B, stages)
                stages.append(equation(t[active] + step, trial))
                size = np.maximum(1.0, np.maximum(np.abs(before), np.abs(trial)))
                error = np.max(np.abs(h * _combine(RK45.E, stages)) / (allowed[active][:, None] * size), axis=1)
                error = np.where(np.isfinite(error), error, np.inf)
                accepted, whole = error <= 1, step == remaining
                change = OPTIONS.safety * np.maximum(error, 1e-10) ** -0.2
                proposal = step * np.clip(change, OPTIONS.smallest_change, OPTIONS.largest_change)
                length[active] = np.where(accepted & whole, np.maximum(length[active], proposal), proposal)
                moved = active[accepted]
                t[moved] = np.where(whole, end, t[active] + step)[accepted]
                y[moved], rate[moved] = trial[accepted], stages[-1][accepted]
            arrived = t >= end
            states[arrived, sample] = y[arrived]
    return states


def _combine(weights: np.ndarray, stages: list[np.ndarray]) -> np.ndarray:
    """Return Σ weights · stages, term by term: the rounding of a matrix product depends on their number."""
    total = weights[0] * stages[0]
    for weight, stage in zip(weights[1 : len(stages)], stages[1:], strict=True):
        total += weight * stage
    return np.asarray(total)
