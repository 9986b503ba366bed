"""IPOPT's program of a motion by splines: the state of a spline is a linear function of the samples.

At every instant the state is projected onto the path along the transposed Jacobian there. The multipliers of this
projection, and their rates, are unknowns; the path equations and their first two time derivatives are constraints.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from casadi import MX, SX, vertcat

from paretoik.robot.kinematics import joint_scales
from paretoik.task.differences import evaluate_with_midpoints, fit_spline
from paretoik.task.joint_curve import target_rates
from paretoik.task.motion_task import MotionTask
from studies.benchmarks.peers.programs import symbols
from studies.benchmarks.peers.quantities import SLACK, at_sample, check, limited_sides, peaks, pose_function, sides_of
from studies.benchmarks.peers.solvers import Peer


def spline_program(task: MotionTask) -> Peer:
    """Return the program of a task. Unknowns: samples, epigraph variables, multipliers of the projection."""
    check(task, "spline")
    assert not task.cyclic, "the path must be open, got a cycle"
    assert all(objective.name != "mechanical_energy" for objective in task.objectives), "no absolute values"
    samples, dof, count, instants = len(task.times), task.arm.dof, len(task.objectives), len(task.instants)
    tops, first = len(peaks(task)), dof * samples
    size = first + tops + 3 * task.rows * instants

    def pack(q: np.ndarray, _: np.ndarray) -> np.ndarray:
        motion = task.motion(q)
        top = [float(objective(motion)) + SLACK for objective in peaks(task)]
        return np.concatenate([q.ravel(), top, np.zeros(size - first - tops)])

    with symbols():
        unknowns, p = MX.sym("x", size), MX.sym("p", 2 * count)
        x, top = casadi.reshape(unknowns[:first], dof, samples), unknowns[first : first + tops]
        # position, velocity and acceleration at the instants, of unit samples
        _, q, rates = evaluate_with_midpoints(fit_spline(np.eye(samples), task.times, cyclic=False, ends_at_rest=False))
        spline = [x @ MX(casadi.sparsify(casadi.DM(matrix.T))) for matrix in (q, rates.dq, rates.ddq)]
        multipliers = casadi.reshape(unknowns[first + tops :], 3 * task.rows, instants)
        wanted = np.concatenate([part.T for part in target_rates(task.tasks, task.instants)])
        worth, limited, off, q, rate, acceleration = _at_instant(task).map(instants)(
            vertcat(*spline), multipliers, casadi.DM(wanted), casadi.repmat(top, 1, instants)
        )
        epigraph = iter(casadi.vertsplit(top) if tops else ())
        integrals = casadi.vertsplit(worth @ MX(task.weights))
        totals: Any = vertcat(
            *(next(epigraph) if each.form == "peak" else integrals[k] for k, each in enumerate(task.objectives))
        )
        # de Boor's control point of the velocity between two samples, v + h a / 2
        inner = rate[:, :-1:2] + acceleration[:, :-1:2] @ MX(np.diag(np.diff(task.times) / 2))
        at_path = pose_function(task).map(samples)(x, task.targets.T)
        low, high = limited_sides(task)
        parts = [
            (limited, np.tile(low, instants), np.tile(high, instants)),
            (inner, *sides_of(task, "velocity", samples - 1)),
            (q[:, 1::2], *sides_of(task, "position", samples - 1)),
            *((each, np.zeros(each.numel()), np.zeros(each.numel())) for each in (at_path, off)),
            (totals / p[count:], np.full(count, -np.inf), np.full(count, np.inf)),
        ]
        lower, upper = sides_of(task, "position", samples)
        f, g = casadi.dot(p[:count], totals / p[count:]), vertcat(*(casadi.vec(each[0]) for each in parts))
        lower, upper = sides_of(task, "position", samples)
        free = np.full(tops + multipliers.numel(), np.inf)
        return Peer(
            solver="ipopt",
            task=task,
            bounds=np.stack([np.concatenate([lower, np.zeros(tops), -free[tops:]]), np.append(upper, free)]),
            pack=pack,
            unpack=lambda x: x[:first].reshape(-1, dof),
            statement={"x": unknowns, "p": p, "f": f, "g": g},
            rows=np.stack([np.concatenate([each[k] for each in parts]) for k in (1, 2)]),
        )


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
