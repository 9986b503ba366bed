"""IPOPT's program of a motion by splines: the state of a spline is a linear function of the samples.

At every instant the state is projected onto the path along the transposed Jacobian there. The multipliers of this
projection, and their rates, are unknowns; the path equations and their first two time derivatives are constraints.
"""

from __future__ import annotations

import warnings
from typing import Any

import casadi
import numpy as np
from casadi import SX, vertcat

from paretoik.robot.kinematics import joint_scales
from paretoik.task.joint_curve import target_rates
from paretoik.task.motion_task import MotionTask
from paretoik.task.sampling import evaluate_with_midpoints, fit_spline
from studies.benchmarks.fronts.programs import (
    JointProgram,
    at_sample,
    limited_sides,
    peaks,
    pose_function,
    solver_options,
)


def spline_program(task: MotionTask) -> JointProgram:
    """Return the program of a task."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # our kernels call NumPy's cosine for symbols too
        program, sides = _written(task)
    options = {warm: solver_options(warm=warm) | {"expand": True} for warm in (False, True)}
    solvers = {warm: casadi.nlpsol("peer", "ipopt", program, each) for warm, each in options.items()}
    return JointProgram(task, solvers, sides)


def derivative_matrices(task: MotionTask) -> tuple[np.ndarray, ...]:
    """Return position, velocity and acceleration at the instants (instants, samples) of unit samples."""
    units = np.eye(len(task.times))
    spline = fit_spline(units, task.times, cyclic=False, ends_at_rest=False)
    _, q, derivatives = evaluate_with_midpoints(spline)
    return q, derivatives.dq, derivatives.ddq


def check(task: MotionTask) -> None:
    """Refuse a task that the program cannot state."""
    assert task.differences == "spline", f"differences must be 'spline', got {task.differences!r}"
    assert task.start is None, "start must be free, got a given one"
    assert not task.cyclic, "the path must be open, got a cycle"
    others = [*task.obstacles, *task.constraints, *(["a stop"] if task.ends_at_rest else [])]
    assert not others, f"limits must be on joints only, got {others}"
    assert all(objective.name != "mechanical_energy" for objective in task.objectives), "no absolute values"


def _written(task: MotionTask) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    check(task)
    samples, dof, count, instants = len(task.times), task.arm.dof, len(task.objectives), len(task.instants)
    tops, first = len(peaks(task)), dof * samples
    unknowns: Any = casadi.MX.sym("x", first + tops + 3 * task.rows * instants)
    p: Any = casadi.MX.sym("p", 2 * count)
    x, top = casadi.reshape(unknowns[:first], dof, samples), unknowns[first : first + tops]
    spline = [x @ casadi.MX(casadi.sparsify(casadi.DM(matrix.T))) for matrix in derivative_matrices(task)]
    multipliers = casadi.reshape(unknowns[first + tops :], 3 * task.rows, instants)
    wanted = np.concatenate([part.T for part in target_rates(task.tasks, task.instants)])
    worth, limited, off, q, rate, acceleration = _at_instant(task).map(instants)(
        casadi.vertcat(*spline), multipliers, casadi.DM(wanted), casadi.repmat(top, 1, instants)
    )
    epigraph = iter(casadi.vertsplit(top) if tops else ())
    integrals = casadi.vertsplit(worth @ casadi.MX(task.weights))
    totals: Any = vertcat(
        *(next(epigraph) if each.form == "peak" else integrals[k] for k, each in enumerate(task.objectives))
    )
    # de Boor's control point of the velocity between two samples, v + h a / 2
    inner = rate[:, :-1:2] + acceleration[:, :-1:2] @ casadi.MX(np.diag(np.diff(task.times) / 2))
    at_path = pose_function(task).map(samples)(x, task.targets.T)
    low, high = limited_sides(task)
    parts = [
        (limited, np.tile(low, instants), np.tile(high, instants)),
        (inner, *_sides(task, "velocity", samples - 1)),
        (q[:, 1::2], *_sides(task, "position", samples - 1)),
        *((each, np.zeros(each.numel()), np.zeros(each.numel())) for each in (at_path, off)),
        (totals / p[count:], np.full(count, -np.inf), np.full(count, np.inf)),
    ]
    positions = _sides(task, "position", samples)
    sides = {
        "lbx": np.concatenate([positions[0], np.zeros(tops), np.full(multipliers.numel(), -np.inf)]),
        "ubx": np.append(positions[1], np.full(tops + multipliers.numel(), np.inf)),
        "lbg": np.concatenate([each[1] for each in parts]),
        "ubg": np.concatenate([each[2] for each in parts]),
    }
    f = casadi.dot(p[:count], totals / p[count:])
    return {"x": unknowns, "p": p, "f": f, "g": vertcat(*(casadi.vec(each[0]) for each in parts))}, sides


def _at_instant(task: MotionTask) -> Any:
    """Return a function of an instant: of spline, multipliers, targets, each with two rates, and peaks.

    Its values are shares of integrals, limited quantities, the curve's distance from its path, and the curve's state.
    """
    dof, rows, numbers = task.arm.dof, task.rows, task.targets.shape[1]
    spline, factors, wanted = SX.sym("s", 3 * dof), SX.sym("l", 3 * rows), SX.sym("x", 3 * numbers)
    top, pose = SX.sym("top", len(peaks(task))), pose_function(task)
    known: Any = vertcat(*(each[: 2 * size] for each, size in ((spline, dof), (factors, rows), (wanted, numbers))))
    rates: Any = vertcat(*(each[size:] for each, size in ((spline, dof), (factors, rows), (wanted, numbers))))

    def with_rates(value: Any) -> list[Any]:
        first = casadi.jtimes(value, known, rates)
        return [value, first, casadi.jtimes(first, known, rates)]

    jacobian: Any = casadi.jacobian(pose(spline[:dof], wanted[:numbers]), spline[:dof])
    weights = casadi.DM(np.diag(joint_scales(task.arm) ** 2))
    curve: Any = with_rates(spline[:dof] + weights @ jacobian.T @ factors[:rows])
    off: Any = with_rates(pose(curve[0], wanted[:numbers]))
    q, rate, acceleration = curve
    shares, limited = at_sample(task, q, rate, acceleration, SX(0, 1), top)
    return casadi.Function("instant", [spline, factors, wanted, top], [shares, limited, vertcat(*off), *curve])


def _sides(task: MotionTask, kind: str, times: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of all joints at a number of times; empty if the task has none."""
    bounds = task.bounds[kind][0] if kind in task.bounds else np.tile([-np.inf, np.inf], (task.arm.dof, 1))
    return np.tile(bounds[:, 0], times), np.tile(bounds[:, 1], times)
