"""One posture, with its gears, for two directions: the nonlinear program of a trade-off, for CasADi and IPOPT.

Like ``full_program``, it is written from the paper's equations and shares only the numbers with the library. A force f
along d needs joint torques Jᵀ f d in addition to the weight, and a motor at rest bears no more than its stall.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.robot.dynamics import gravity_torques
from studies.kim_2021.full_program import LENGTHS, QUIET, SPEED, diamond, linkage, solver_options
from studies.kim_2021.motion_program import JOINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureProgram:
    """The most of the second objective with no less of the first than a given value.

    Unknowns: joint positions, for sliders their front positions [rods' lengths], for every speed the motors' speeds as
    shares of the fastest, and both values [``SPEED``, 10 N].
    """

    problem: pk.DirectionalMaxima
    solver: Any
    equalities: int
    inequalities: int
    sizes: Float[np.ndarray, " 2"]

    def solved(self, genes: Float[np.ndarray, " n_var"]) -> float:
        """Return the most of the second objective that IPOPT finds from a point, NaN where it ends at no optimum."""
        at = self.problem.configuration(genes[None])
        motors: Any = self.problem.actuation
        speeds = at.dq[0][:, None]
        parts = [at.q[0]]
        if isinstance(motors, pk.capability.DistributedActuation):
            parts.append(at.front[0] / motors.rod)
            speeds = self.problem.configurations.slider_speeds(at, gravity_torques(self.problem.arm, at.q))[0]
        fastest = np.stack([curve.fastest for curve in motors.curves])
        start = np.concatenate([*parts, (speeds / fastest).ravel(), at.values[0] / self.sizes])
        lower = np.zeros(self.equalities + self.inequalities)
        upper = np.where(np.arange(len(lower)) < self.equalities, 0.0, np.inf)
        solution = self.solver(x0=start, p=at.values[0, 0] / self.sizes[0], lbg=lower, ubg=upper)
        success = self.solver.stats()["return_status"] == "Solve_Succeeded"
        return float(solution["x"][-1] * self.sizes[1]) if success else np.nan


def posture_program(problem: pk.DirectionalMaxima, tolerance: float = 1e-9) -> PostureProgram:
    """Return the program of a problem with the paper's arm, two directions and no power."""
    motors: Any = problem.actuation
    kinds, quantities = len(motors.curves), problem.configurations.quantities
    q, front, values = ca.SX.sym("q", JOINTS), ca.SX.sym("front", JOINTS * (kinds - 1)), ca.SX.sym("values", 2)
    shares, least = ca.SX.sym("shares", JOINTS * kinds * quantities.count("velocity")), ca.SX.sym("least")
    place, columns, load = linkage(q)
    gears, rows = _gears(motors, q, front)
    equal = [(place[a] - problem.position[a]) / LENGTHS[0] for a in range(2)]
    sizes = np.array([SPEED if quantity == "velocity" else 10.0 for quantity in quantities])
    before = 0
    for k, (quantity, way) in enumerate(zip(quantities, problem.directions, strict=True)):
        if quantity == "force":
            torque = [load[j] + sizes[k] * values[k] * sum(columns[j][a] * way[a] for a in range(2)) for j in range(3)]
            shown = [each for pair in zip(load, torque, strict=True) for each in pair]
            rows += [
                1 + sign * gears[m // 2][n] * each / curve.stall[m // 2]
                for m, each in enumerate(shown)
                for n, curve in enumerate(motors.curves)
                for sign in (-1.0, 1.0)
            ]
            continue
        block = shares[before : before + JOINTS * kinds]
        before += JOINTS * kinds
        rates = [0.0] * JOINTS
        for n, curve in enumerate(motors.curves):
            for j in range(JOINTS):
                rates[j] += gears[j][n] * curve.fastest[j] * block[n * JOINTS + j]
                rows += diamond(gears[j][n] * load[j] / curve.stall[j], block[n * JOINTS + j])
        equal += [
            sum(columns[j][a] * rates[j] for j in range(JOINTS)) / sizes[k] - values[k] * way[a] for a in range(2)
        ]
    unknowns = ca.vertcat(q, front, shares, values)
    rows.append(values[0] - least)
    program = {"x": unknowns, "p": least, "f": -values[1], "g": ca.vertcat(*equal, *rows)}
    options = {**QUIET, **solver_options(tolerance), "ipopt.bound_relax_factor": 0.0, "ipopt.mu_init": 1e-4}
    return PostureProgram(
        problem=problem,
        solver=ca.nlpsol("posture", "ipopt", program, options),
        equalities=len(equal),
        inequalities=len(rows),
        sizes=sizes,
    )


def _gears(motors: Any, q: Any, front: Any) -> tuple[list[list[Any]], list[Any]]:
    """Return each joint's speed per speed of its motors, and rows for sliders within their bounds."""
    if isinstance(motors, pk.capability.JointActuation):
        return [[1.0]] * JOINTS, []
    gears, rows = list[list[Any]](), list[Any]()
    for j in range(JOINTS):
        angle, s, rod = motors.bend[j] * (q[j] - motors.zero[j]), motors.rod[j] * front[j], motors.rod[j]
        back = -s * ca.cos(angle) + ca.sqrt(rod**2 - (s * ca.sin(angle)) ** 2)
        across = s * back * ca.sin(angle)
        gears.append([motors.bend[j] * (one + other * ca.cos(angle)) / across for one, other in ((s, back), (back, s))])
        for place, (low, high) in ((s, motors.front_bounds[j]), (back, motors.back_bounds[j])):
            rows += [(place - low) / rod, (high - place) / rod]
        rows += [angle - motors.least_angle[j], np.pi - motors.least_angle[j] - angle]
    return gears, rows
