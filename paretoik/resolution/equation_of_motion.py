"""The equation of motion of least kinetic energy under a path, M q̈ + n = Jᵀλ with J q̇ = ẋ; see ``variational``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import make_interp_spline

from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.operations import Op
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.errors import InvalidInput
from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.task.motion_task import MotionTask
from paretoik.task.task import path_equations


@dataclass(frozen=True, kw_only=True)
class EquationOptions:
    """Settings of the equation of motion."""

    knots: int = 2000  # of the splines through the targets, which give their derivatives in time
    massless: float = 1e-12  # ratio of the inertia matrix's eigenvalues below which a joint moves no mass


OPTIONS = EquationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The terms at one instant: J, the rates ẋ and accelerations that J q̇ and J q̈ must equal, M, and n(q, q̇)."""

    jacobian: Float[np.ndarray, "motions rows dof"]
    velocity: Float[np.ndarray, "motions rows"]
    acceleration: Float[np.ndarray, "motions rows"]
    inertia: Float[np.ndarray, "motions dof dof"]
    torque: Float[np.ndarray, "motions dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class EquationOfMotion:
    """M q̈ + n = Jᵀλ with J q̇ = ẋ; ``targets`` are splines of the targets and of their two derivatives in time.

    ``sign`` is that of n, −1; Tringali & Cocuzza 2020 print 1 in Eq. 20; ``program`` computes what ``Terms`` hold.
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
        """Return the velocities nearest to dq, in the metric of the inertia, that follow the path."""
        terms = self.terms(t, q, dq)
        return _solve_kkt(terms, (terms.inertia @ dq[..., None])[..., 0], terms.velocity)

    def terms(self, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> Terms:
        """Return the terms at times t (motions,), of postures and velocities (motions, dof)."""
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
    """Return the equation of motion of a task.

    Raises InvalidInput for a cyclic task, and an arm with joints that move no mass.
    """
    if task.cyclic:
        raise InvalidInput("variational: wants an open motion, got a cyclic one")
    inertia = dynamics.inertia_matrix(task.arm, np.full((1, task.arm.dof), 0.5))[0]
    smallest, largest = np.linalg.eigvalsh(inertia)[[0, -1]]
    if smallest <= OPTIONS.massless * largest:
        raise InvalidInput(f"variational: wants an arm whose every joint moves a mass, {task.arm.name} has others")
    parts = max(1, -(-OPTIONS.knots // (len(task.times) - 1)))
    knots = np.interp(np.arange(parts * (len(task.times) - 1) + 1) / parts, np.arange(len(task.times)), task.times)
    spline = make_interp_spline(knots, np.concatenate([each.targets(knots) for each in task.tasks], axis=1), k=5)
    return EquationOfMotion(
        task=task,
        targets=(spline, spline.derivative(), spline.derivative(2)),
        sign=-1.0,
        program=_terms_program(task, task.arm.mounted(gravity=(0.0, 0.0, 0.0))),
    )


def _terms_program(task: MotionTask, arm: Arm) -> Evaluator:
    """Return the program of ``Terms``, of q, q̇, and the targets with their two derivatives in time.

    Along the path the path equations h(q, x) = 0 keep holding: J q̇ + ∂h/∂x ẋ = 0, and once more.
    """
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
    return compile_evaluator(tape, [*jacobian, *negated, *forces])


def _solve_kkt(terms: Terms, force: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return x with J x = ``rates`` and M x = ``force`` + Jᵀλ, which is J_B⁺ rates + (I − J_B⁺J) M⁻¹ force.

    It is NaN at a singularity.
    """
    rows, dof = terms.jacobian.shape[1:]
    matrix = np.zeros((len(rates), dof + rows, dof + rows))
    matrix[:, :dof, :dof], matrix[:, dof:, :dof] = terms.inertia, terms.jacobian
    matrix[:, :dof, dof:] = np.swapaxes(terms.jacobian, 1, 2)
    matrix[np.linalg.det(matrix) == 0] = np.nan
    right = np.concatenate([force, rates], axis=1)[..., None]
    solution: np.ndarray = np.linalg.solve(matrix, right)[:, :dof, 0]
    return solution
