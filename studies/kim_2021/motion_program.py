"""A motion from point to point as one nonlinear program, for CasADi and IPOPT: splines, intervals and work at once.

Like ``full_program``, it is written from the paper's equations and shares only the numbers with the library.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float

import paretoik as pk
from studies.kim_2021.full_program import LENGTHS, QUIET, diamond, linkage, solver_options

STEP = 0.1  # s: unit of intervals
WORK = 0.1  # J: unit of a motor's work in an interval
JOINTS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProgram:
    """The least ``weights`` · (duration [s], energy [J]) of motions with at most a given duration.

    Unknowns: coefficients of joints, and of front sliders [rods' lengths], intervals, and the work of every motor.
    """

    solver: Any
    equalities: int
    inequalities: int
    rod: Float[np.ndarray, " 3"] | None
    values: Any

    def solved(
        self, start: np.ndarray, weights: tuple[float, float], longest: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return the unknowns found, their duration [s] and energy [J], and whether IPOPT ended at an optimum."""
        rows = np.zeros(self.equalities + self.inequalities + 1)
        upper = np.concatenate([rows[: self.equalities], np.full(self.inequalities, np.inf), [longest]])
        lower = np.concatenate([rows[:-1], [-np.inf]])
        solution = self.solver(x0=start, p=np.array(weights), lbg=lower, ubg=upper)
        z = np.array(solution["x"])[:, 0]
        success = self.solver.stats()["return_status"] == "Solve_Succeeded"
        return z, np.array(self.values(z))[:, 0], success

    def start(self, problem: pk.PointToPoint, genes: np.ndarray) -> np.ndarray:
        """Return the unknowns of genes (n_var,)."""
        q, front, _ = problem.profiles(genes[None])
        timing = problem.timing(genes[None])
        parts = [q, *([] if self.rod is None else [front / self.rod]), timing.intervals / STEP, timing.work / WORK]
        return np.concatenate([part.ravel() for part in parts])


def motion_program(problem: pk.PointToPoint, tolerance: float = 1e-8) -> MotionProgram:
    """Return the program of a problem with the paper's arm and diamonds, for IPOPT with a tolerance."""
    motors: Any = problem.actuation
    spline = problem.initial_paths.spline
    samples, coefficients = spline.shape
    sliding = isinstance(motors, pk.capability.DistributedActuation)
    kinds = 2 if sliding else 1
    q, front = ca.SX.sym("q", JOINTS, coefficients), ca.SX.sym("front", JOINTS, coefficients * (kinds - 1))
    steps, work = ca.SX.sym("steps", samples - 1), ca.SX.sym("work", JOINTS * kinds, samples - 1)
    moved, slid = q @ ca.DM(spline).T, (front @ ca.DM(spline).T if sliding else None)
    equal = [
        (linkage(moved[:, k])[0][a] - place[a]) / LENGTHS[0]
        for k, place in ((0, problem.start), (samples - 1, problem.target))
        for a in range(2)
    ]
    rows = list[Any]()
    for k in range(samples):
        rows += _held(motors, moved[:, k], None if slid is None else slid[:, k])
    for k in range(samples - 1):
        pair = None if slid is None else slid[:, k : k + 2]
        rows += _driven(motors, moved[:, k : k + 2], pair, steps[k], work[:, k])
    weights = ca.SX.sym("weights", 2)
    duration, energy = STEP * ca.sum1(steps), WORK * ca.sum1(ca.vec(work))
    unknowns = ca.vertcat(ca.vec(q), ca.vec(front), steps, ca.vec(work))
    program = {
        "x": unknowns,
        "p": weights,
        "f": weights[0] * duration + weights[1] * energy,
        "g": ca.vertcat(*equal, *rows, duration),
    }
    return MotionProgram(
        solver=ca.nlpsol(
            "motion",
            "ipopt",
            program,
            {**QUIET, **solver_options(tolerance), "ipopt.max_iter": 1000, "ipopt.bound_relax_factor": 0.0},
        ),
        equalities=len(equal),
        inequalities=len(rows),
        rod=motors.rod if sliding else None,
        values=ca.Function("values", [unknowns], [ca.vertcat(duration, energy)]),
    )


def _held(motors: Any, q: Any, front: Any) -> list[Any]:
    """Return rows for sliders within their bounds, and for motors that hold the arm still."""
    load = linkage(q)[2]
    rows = [] if front is None else _bounds(motors, q, front)
    for j in range(JOINTS):
        pairs = [(load[j], motors.motors)] if front is None else _efforts(motors, j, q[j], front[j], load[j])
        rows += [1 + sign * effort / curve.stall[j] for effort, curve in pairs for sign in (-1.0, 1.0)]
    return rows


def _driven(motors: Any, q: Any, front: Any, step: Any, work: Any) -> list[Any]:
    """Return rows for motors within their diamonds, and for their work, between two samples."""
    load, rows = linkage((q[:, 0] + q[:, 1]) / 2)[2], [step]
    for j in range(JOINTS):
        if front is None:
            known = [(load[j], q[j, 1] - q[j, 0], motors.motors, work[j])]
        else:
            known = _sliders(motors, j, q[j, :], front[j, :], load[j], work[j::JOINTS])
        for effort, way, curve, spent in known:
            rows += diamond(effort / curve.stall[j] * step, way / (curve.fastest[j] * STEP), step)
            rows += [spent - sign * effort * way / WORK for sign in (-1.0, 1.0)]
    return rows


def _place(motors: Any, j: int, q: Any, front: Any) -> tuple[Any, Any, Any]:
    """Return the rod's angle, the front slider and the back slider [m]."""
    angle, s = motors.bend[j] * (q - motors.zero[j]), motors.rod[j] * front
    return angle, s, -s * ca.cos(angle) + ca.sqrt(motors.rod[j] ** 2 - (s * ca.sin(angle)) ** 2)


def _bounds(motors: Any, q: Any, front: Any) -> list[Any]:
    rows = list[Any]()
    for j in range(JOINTS):
        angle, s, back = _place(motors, j, q[j], front[j])
        for place, (low, high) in ((s, motors.front_bounds[j]), (back, motors.back_bounds[j])):
            rows += [(place - low) / motors.rod[j], (high - place) / motors.rod[j]]
        rows += [angle - motors.least_angle[j], np.pi - motors.least_angle[j] - angle]
    return rows


def _sliders(motors: Any, j: int, q: Any, front: Any, load: Any, work: Any) -> list[tuple[Any, Any, Any, Any]]:
    """Return effort, way, curve and work of both sliders of a joint between two samples."""
    places = [_place(motors, j, q[k], front[k]) for k in range(2)]
    pairs = _efforts(motors, j, (q[0] + q[1]) / 2, (front[0] + front[1]) / 2, load)
    return [(effort, places[1][m + 1] - places[0][m + 1], curve, work[m]) for m, (effort, curve) in enumerate(pairs)]


def _efforts(motors: Any, j: int, q: Any, front: Any, load: Any) -> list[tuple[Any, Any]]:
    """Return effort and curve of both sliders of a joint."""
    angle, s, back = _place(motors, j, q, front)
    a = (s + back * ca.cos(angle)) / (s * back * ca.sin(angle))
    b = (back + s * ca.cos(angle)) / (s * back * ca.sin(angle))
    return [(motors.bend[j] * gear * load, curve) for gear, curve in ((a, motors.front), (b, motors.back))]
