"""The nonlinear program that minimises an objective over a few samples ahead.

    minimise    Σ f(qₖ, q̇ₖ, q̈ₖ) Δt      over q₁ ... q_h, the last sample with a terminal weight
    subject to  h(qₖ, xₖ) = 0             the path's equations, sample by sample

Rates are backward differences, the first from the given posture and velocity. The program is solved by sequential
quadratic programming in the null space of the equations' Jacobian, with the exact Hessian of the Lagrangian; every step
is retracted onto the path.

Source: Tringali & Cocuzza 2021, Eq. 4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies, gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import Trace
from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.task import path_equations, path_jacobian
from paretoik.task.traced_motion import TracedMotion, trace_sample_function

DEGREE = 4  # degree of the splines through the positions ahead


@dataclass(frozen=True, kw_only=True, eq=False)
class HorizonSolution:
    """The positions ahead, their objective, whether they are stationary on the path, and the iterations."""

    q: Float[np.ndarray, "horizon dof"]
    value: float
    converged: bool
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class HorizonProgram:
    """The program of a few samples ahead.

    horizon: number of samples
    interval: time between samples [s]
    terminal: additional weight of the last sample
    derivatives: evaluator of the objective, its gradient, the path's equations and their Jacobian by samples; the
        inputs are positions ahead, posture, velocity, targets, terminal weight and interval
    hessian: evaluator of the entries of the Lagrangian's Hessian at ``indices`` (rows, columns), with multipliers as
        more inputs
    """

    horizon: int
    dof: int
    rows: int
    derivatives: Evaluator
    hessian: Evaluator
    indices: tuple[np.ndarray, np.ndarray]
    interval: float = 1.0
    terminal: float = 0.0

    def inputs(
        self,
        q: Float[np.ndarray, "horizon dof"],
        posture: Float[np.ndarray, " dof"],
        velocity: Float[np.ndarray, " dof"],
        targets: Float[np.ndarray, "horizon numbers"],
    ) -> Float[np.ndarray, "inputs 1"]:
        """Return the inputs of the evaluators; multipliers and jerk are 0."""
        settings, zeros = [self.terminal, self.interval], np.zeros(self.horizon * self.rows + self.dof)
        return np.concatenate([q.ravel(), posture, velocity, targets.ravel(), settings, zeros])[:, None]

    def solve(
        self,
        q: Float[np.ndarray, "horizon dof"],
        posture: Float[np.ndarray, " dof"],
        velocity: Float[np.ndarray, " dof"],
        targets: Float[np.ndarray, "horizon numbers"],
    ) -> HorizonSolution:
        """Return the local minimum found from the positions ahead ``q``, after a posture and its velocity."""
        from paretoik.resolution.horizon_newton import minimise  # here: numba is slow to load

        inputs = self.inputs(q, posture, velocity, targets)
        evaluators = self.derivatives.arrays, self.hessian.arrays
        value, converged, iterations = minimise(*evaluators, *self.indices, inputs, self.horizon, self.dof, self.rows)
        solution = inputs[: q.size].reshape(q.shape)
        return HorizonSolution(q=solution, value=value, converged=converged, iterations=iterations)


def horizon_program(
    task: MotionTask, objective: Objective, horizon: int, interval: float, terminal: float = 0.0
) -> HorizonProgram:
    """Return the program of an objective over samples ahead, the last with ``terminal`` more weight.

    Raises InvalidInput, naming the objective, if it depends on more than one sample's positions, velocities and
    accelerations, or on none of them.
    """
    return replace(_trace_program(task, objective, horizon), interval=interval, terminal=terminal)


@lru_cache(maxsize=64)  # a search over a method's numbers uses the same few programs repeatedly
def _trace_program(task: MotionTask, objective: Objective, horizon: int) -> HorizonProgram:
    n, label = task.arm.dof, f"objective {objective.name}"
    if objective.form != "integral":
        raise InvalidInput(f"{label}: form must be 'integral', got {shown(objective.form)}")
    trace = Trace(len(task.times))
    tape = trace.tape
    samples = [trace.inputs(n) for _ in range(horizon)]
    posture, velocity = trace.inputs(n), trace.inputs(n)
    targets = [list(trace.inputs(task.targets.shape[1]).entries) for _ in range(horizon)]
    (terminal,), interval = trace.inputs(1).entries, trace.inputs(1)
    multipliers = [trace.inputs(task.rows) for _ in range(horizon)]
    jerk = trace.inputs(n)
    previous, previous_rate = posture, velocity
    total, equations, jacobian = tape.constant(0.0), list[int](), list[int]()
    for q, numbers in zip(samples, targets, strict=True):
        dq = (q - previous) * (1.0 / interval)
        ddq = (dq - previous_rate) * (1.0 / interval)
        previous, previous_rate = q, dq
        motion = TracedMotion(task, trace, q, dq, ddq, jerk, float(np.ptp(task.times)))
        value = trace_sample_function(motion, label, objective.function)
        if value is None:
            raise InvalidInput(f"{label}: looks at more than one sample")
        term = Expression(tape, as_entry(tape, value)) * objective.sign * interval.entries[0]
        total = as_entry(tape, Expression(tape, total) + term)
        positions = list(q.entries)
        equations += [as_entry(tape, one) for one in path_equations(task.arm, task.tasks, positions, numbers)]
        jacobian += [as_entry(tape, one) for one in path_jacobian(task.arm, task.tasks, positions)]
    total = as_entry(tape, Expression(tape, total) + terminal * term)
    read, variables = set(dependencies(tape, [total])), [as_entry(tape, one) for q in samples for one in q.entries]
    if read & {as_entry(tape, one) for one in jerk.entries} or trace.parameters:
        raise InvalidInput(
            f"{label} must be a function of positions, velocities and accelerations of one sample, got another"
        )
    if not read & set(variables):
        raise InvalidInput(f"{label}: is the same whatever {task.arm.name} does; has it no masses?")
    lagrangian = Expression(tape, total)
    for factor, equation in zip([one for each in multipliers for one in each.entries], equations, strict=True):
        lagrangian = lagrangian + factor * Expression(tape, equation)
    second = hessian(tape, as_entry(tape, lagrangian), variables)
    indices = np.array(list(second)).reshape(-1, 2).T
    return HorizonProgram(
        horizon=horizon,
        dof=n,
        rows=task.rows,
        derivatives=compile_evaluator(tape, [total, *gradient(tape, total, variables), *equations, *jacobian]),
        hessian=compile_evaluator(tape, list(second.values())),
        indices=(indices[0], indices[1]),
    )


def quartic_spline(
    points: Float[np.ndarray, "points dof"], rate: Float[np.ndarray, " dof"], second: Float[np.ndarray, " dof"]
) -> Float[np.ndarray, "pieces 5 dof"]:
    """Return the coefficients of a C² quartic spline through points one unit of time apart.

    Its derivatives are ``rate`` and ``second`` at the first point, and 0 at the last; only the first is 0 there if the
    spline has one piece. These conditions determine two pieces, as in the paper; with more pieces, the jerk is
    minimised.
    """
    pieces, dof = len(points) - 1, points.shape[1]
    conditions = np.concatenate([points[:-1], points[1:], rate[None], second[None]])
    return (_coefficient_matrix(pieces) @ conditions).reshape(pieces, DEGREE + 1, dof)


def spline_position(coefficients: Float[np.ndarray, "pieces 5 dof"], time: float) -> Float[np.ndarray, " dof"]:
    """Return the spline's position at a time in units of pieces, constant after its end."""
    piece = min(int(time), len(coefficients) - 1)
    u = min(time - piece, 1.0)
    position: np.ndarray = u ** np.arange(DEGREE + 1) @ coefficients[piece]
    return position


@lru_cache(maxsize=32)
def _coefficient_matrix(pieces: int) -> np.ndarray:
    """Return the matrix from the positions of pieces' ends and first derivatives to coefficients."""
    width, powers = DEGREE + 1, np.arange(DEGREE + 1)

    def derivative(order: int, u: float) -> np.ndarray:
        factors = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(width)
        return np.asarray(np.where(powers >= order, factors * float(u) ** np.maximum(powers - order, 0), 0.0))

    def condition(*parts: tuple[int, np.ndarray]) -> np.ndarray:
        row = np.zeros((pieces, width))
        for piece, values in parts:
            row[piece] = values
        return row.ravel()

    rows = [condition((i, derivative(0, u))) for u in (0, 1) for i in range(pieces)]
    rows += [condition((0, derivative(order, 0))) for order in (1, 2)]
    inhomogeneous = len(rows)
    rows += [condition((pieces - 1, derivative(order, 1))) for order in ((1, 2) if pieces > 1 else (1,))]
    for i in range(1, pieces):
        rows += [condition((i - 1, derivative(order, 1)), (i, -derivative(order, 0))) for order in (1, 2)]
    jerk = np.zeros((width, width))
    jerk[3:, 3:] = [[36.0, 72.0], [72.0, 192.0]]  # ∫ (6 c₃ + 24 c₄ u)² du
    size, equalities = pieces * width, np.array(rows)
    kkt = np.block([[np.kron(np.eye(pieces), jerk), equalities.T], [equalities, np.zeros((len(rows), len(rows)))]])
    return np.linalg.inv(kkt)[:size, size : size + inhomogeneous]
