"""Equation 1 as one nonlinear program, for CasADi and IPOPT: posture, sliders and thrusts at once, one direction.

It is written from the paper's equations (motor curves as diamonds). It shares with the library only the numbers, and
which random postures are starts: those that can be held.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float

import paretoik as pk
from studies.kim_2021.profiles import Mechanism, nodes
from studies.kim_2021.setting import POSITIONS, actuation_of

LENGTHS, MASS, GRAVITY = (0.114, 0.114, 0.129), 0.5, 9.81
DRAWN = 2000  # postures drawn at once
SPEED = 0.1  # m/s: unit of speeds
QUIET: dict[str, Any] = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "ipopt.acceptable_iter": 0,
}


def solver_options(tolerance: float) -> dict[str, float]:
    """Return IPOPT's settings for a tolerance."""
    return {"ipopt.tol": tolerance, "ipopt.constr_viol_tol": tolerance}


@dataclass(frozen=True, kw_only=True, eq=False)
class FullProgram:
    """The program of a mechanism, built once for all positions and directions.

    Unknowns: joint positions (3), for sliders their front positions [rods' lengths] (3), motor speeds as shares of the
    fastest (3, or 6 front and back), the tool's speed [``SPEED``].
    """

    solver: Any
    lower: Float[np.ndarray, " unknowns"]
    upper: Float[np.ndarray, " unknowns"]
    inequalities: int
    mechanism: Mechanism

    def solved(self, start: np.ndarray, position: np.ndarray, direction: np.ndarray) -> tuple[float, bool]:
        """Return the speed found [m/s], and whether IPOPT ended at an optimum."""
        solution = self.solver(
            x0=start,
            p=np.concatenate([position, direction]),
            lbx=self.lower,
            ubx=self.upper,
            lbg=np.zeros(4 + self.inequalities),
            ubg=np.concatenate([np.zeros(4), np.full(self.inequalities, np.inf)]),
        )
        return SPEED * float(solution["x"][-1]), self.solver.stats()["return_status"] == "Solve_Succeeded"

    def starts(self, position: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return unknowns at rest in random postures that can be held, with sliders in fitting positions."""
        motors, postures, rows = self.mechanism.actuation, np.zeros((0, len(self.lower))), DRAWN
        while len(postures) < count:
            angles, elbows = rng.uniform(0, 2 * np.pi, (1, rows)), rng.choice([-1.0, 1.0], (1, rows))
            known = nodes(self.mechanism, position[None], angles, elbows)
            q, able = known.q[0], np.isfinite(known.slowness).all(axis=(0, 1, 3))
            parts = [q]
            if isinstance(motors, pk.capability.DistributedActuation):
                q[:] = motors.zero + (q - motors.zero) % (2 * np.pi)  # the turn with rods' angles in bounds
                low, high = motors.front_bounds.T
                front = low + (high - low) * rng.uniform(size=(rows, 3))
                back = motors.gears(q[able], front[able])[0]
                able[able] = ((back >= motors.back_bounds[:, 0]) & (back <= motors.back_bounds[:, 1])).all(axis=1)
                parts.append(front / motors.rod)
            shares = 0.1 * rng.uniform(-1, 1, (rows, len(self.lower) - 3 * len(parts) - 1))
            postures = np.concatenate([postures, np.hstack([*parts, shares, np.zeros((rows, 1))])[able]])
        return postures[:count]


@cache
def full_program(mechanism: str, tolerance: float = 1e-10) -> FullProgram:
    """Return the program of "JAM" or "DAM" for IPOPT, with a tolerance."""
    motors = actuation_of(mechanism)
    given, q, speed = ca.SX.sym("given", 4), ca.SX.sym("q", 3), ca.SX.sym("speed")
    place, columns, torque = linkage(q)
    if isinstance(motors, pk.capability.JointActuation):
        share = ca.SX.sym("share", 3)
        unknowns = [q, share, speed]
        rates = [motors.motors.fastest[j] * share[j] for j in range(3)]
        rows = [row for j in range(3) for row in diamond(torque[j] / motors.motors.stall[j], share[j])]
        ends = [(-np.inf, np.inf)] * 3 + [(-1.0, 1.0)] * 3
    else:
        front, share = ca.SX.sym("front", 3), ca.SX.sym("share", 6)
        unknowns = [q, front, share, speed]
        rates, rows = _sliding(motors, q, front, share, torque)
        angles = [(low, np.pi - low) for low in motors.least_angle]
        ends = [(motors.zero[j] + low, motors.zero[j] + high) for j, (low, high) in enumerate(angles)]
        ends += [tuple(pair / rod) for pair, rod in zip(motors.front_bounds, motors.rod, strict=True)]
        ends += [(-1.0, 1.0)] * 6
    moved = [sum(columns[j][a] * rates[j] for j in range(3)) / SPEED - speed * given[2 + a] for a in range(2)]
    equal = [(place[a] - given[a]) / LENGTHS[0] for a in range(2)] + moved
    program = {"x": ca.vertcat(*unknowns), "p": given, "f": -speed, "g": ca.vertcat(*equal, *rows)}
    lower, upper = np.array([*ends, (0.0, np.inf)]).T
    return FullProgram(
        solver=ca.nlpsol("full", "ipopt", program, {**QUIET, **solver_options(tolerance)}),
        lower=lower,
        upper=upper,
        inequalities=len(rows),
        mechanism=Mechanism(arm=pk.arms.kim_3r(), actuation=motors),
    )


def linkage(q: Any) -> tuple[list[Any], list[Any], list[Any]]:
    """Return the tool's position, the columns of its Jacobian, and the torques that hold the arm against gravity."""
    heading, joint = 0.0, [0.0, 0.0]
    joints, middles = [], []
    for j, length in enumerate(LENGTHS):
        heading = heading + q[j]
        direction = [ca.cos(heading), ca.sin(heading)]
        joints.append(joint)
        middles.append(joint[0] + length / 2 * direction[0])
        joint = [joint[a] + length * direction[a] for a in range(2)]
    columns = [[-(joint[1] - place[1]), joint[0] - place[0]] for place in joints]
    torque = [MASS * GRAVITY * sum(middle - place[0] for middle in middles[j:]) for j, place in enumerate(joints)]
    return joint, columns, torque


def _sliding(
    motors: pk.capability.DistributedActuation, q: Any, front: Any, share: Any, torque: list[Any]
) -> tuple[list[Any], list[Any]]:
    """Return joint speeds, and rows for back sliders and motors that must not be negative."""
    rates, rows = list[Any](), list[Any]()
    for j in range(3):
        angle, s = motors.bend[j] * (q[j] - motors.zero[j]), motors.rod[j] * front[j]
        back = -s * ca.cos(angle) + ca.sqrt(motors.rod[j] ** 2 - (s * ca.sin(angle)) ** 2)
        a = (s + back * ca.cos(angle)) / (s * back * ca.sin(angle))
        b = (back + s * ca.cos(angle)) / (s * back * ca.sin(angle))
        low, high = motors.back_bounds[j]
        rows += [(back - low) / motors.rod[j], (high - back) / motors.rod[j]]
        pairs = ((a, motors.front, share[j]), (b, motors.back, share[3 + j]))
        rates.append(motors.bend[j] * sum(gear * curve.fastest[j] * part for gear, curve, part in pairs))
        for gear, curve, part in pairs:
            rows += diamond(motors.bend[j] * gear * torque[j] / curve.stall[j], part)
    return rates, rows


def diamond(effort: Any, speed: Any, whole: Any = 1.0) -> list[Any]:
    """Return rows that are not negative if the sizes of both sum to no more than the whole."""
    return [whole - effort - speed, whole - effort + speed, whole + effort - speed, whole + effort + speed]


def places() -> dict[str, np.ndarray]:
    """Return the positions of the trials: that of Figure 5, and the start and middle of Figure 8."""
    return {name: POSITIONS[name] for name in ("p6", "p4", "p5")}
