"""Nonlinear programs of the paper's equations, for CasADi and IPOPT; they share only the numbers with the library.

Motor curves are diamonds. With sliders, a joint's speed depends on the places of both sliders. A force f along d needs
joint torques Jᵀ f d in addition to the weight, and a motor at rest bears no more than its stall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

import paretoik as pk
from paretoik.capability.joint_capability import Quantity
from paretoik.capability.speed_models import PolynomialEllipsoids
from paretoik.robot.dynamics import gravity_torques
from studies.kim_2021.maxima import actuation_of
from studies.kim_2021.postures import Mechanism, nodes

LENGTHS, MASS, GRAVITY = (0.114, 0.114, 0.129), 0.5, 9.81
JOINTS = 3
SIZES = {"velocity": 0.1, "force": 10.0}  # m/s and N: units of values
STEP, WORK, LENGTH = 0.1, 0.1, 0.1  # s, J and m: units of intervals, of a motor's work in one, and of points
DRAWN = 2000  # postures drawn at once


def ipopt(program: dict[str, Any], tolerance: float, **settings: Any) -> Any:
    """Return IPOPT for a program."""
    quiet: dict[str, Any] = {
        "print_level": 0,
        "sb": "yes",
        "acceptable_iter": 0,
        "tol": tolerance,
        "constr_viol_tol": tolerance,
    }
    return ca.nlpsol("peer", "ipopt", program, {"print_time": False, "ipopt": {**quiet, **settings}})


def succeeded(solver: Any) -> bool:
    """Return whether IPOPT ended at an optimum."""
    return bool(solver.stats()["return_status"] == "Solve_Succeeded")


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


def transmission(motors: Any, j: int, q: Any, front: Any) -> tuple[Any, list[Any], list[Any]]:
    """Return a joint's rod angle, its sliders' places [m], and its speed per speed of each motor."""
    if isinstance(motors, pk.capability.JointActuation):
        return None, [], [1.0]
    angle, s, rod = motors.bend[j] * (q - motors.zero[j]), motors.rod[j] * front, motors.rod[j]
    back = -s * ca.cos(angle) + ca.sqrt(rod**2 - (s * ca.sin(angle)) ** 2)
    across = s * back * ca.sin(angle)
    gears = [motors.bend[j] * (one + other * ca.cos(angle)) / across for one, other in ((s, back), (back, s))]
    return angle, [s, back], gears


def within_bounds(motors: Any, j: int, angle: Any, places: Sequence[Any]) -> list[Any]:
    """Return rows that are not negative if a joint's sliders and its rod are within their bounds."""
    rows = list[Any]()
    for place, (low, high) in zip(places, (motors.front_bounds[j], motors.back_bounds[j]), strict=True):
        rows += [(place - low) / motors.rod[j], (high - place) / motors.rod[j]]
    return [*rows, angle - motors.least_angle[j], np.pi - motors.least_angle[j] - angle]


def diamond(effort: Any, speed: Any, whole: Any = 1.0) -> list[Any]:
    """Return rows that are not negative if the sizes of both sum to no more than the whole."""
    return [whole - effort - speed, whole - effort + speed, whole + effort - speed, whole + effort + speed]


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureProgram:
    """The most of the last of one or two values along given directions, with no less of the first than a given one.

    Unknowns: joint positions, for sliders their front positions [rods' lengths], for every speed the motors' speeds as
    shares of the fastest, and the values in their units.
    """

    mechanism: Mechanism
    quantities: tuple[Quantity, ...]
    solver: Any
    lower: Float[np.ndarray, " unknowns"]
    upper: Float[np.ndarray, " unknowns"]
    highest: Float[np.ndarray, " rows"]

    def solved(
        self, start: np.ndarray, position: ArrayLike, directions: ArrayLike, least: float = 0.0
    ) -> tuple[float, bool]:
        """Return the last value found [m/s, N], and whether IPOPT ended at an optimum."""
        given = np.concatenate([np.ravel(position), np.ravel(directions), [least / SIZES[self.quantities[0]]]])
        bounds = {"lbx": self.lower, "ubx": self.upper, "lbg": 0.0, "ubg": self.highest}
        solution = self.solver(x0=start, p=given, **bounds)
        return SIZES[self.quantities[-1]] * float(solution["x"][-1]), succeeded(self.solver)

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

    def start_at(self, problem: pk.DirectionalMaxima, genes: Float[np.ndarray, " n_var"]) -> np.ndarray:
        """Return the unknowns of genes of a problem with these quantities."""
        at, motors = problem.configuration(genes[None]), self.mechanism.actuation
        speeds, parts = at.dq[0][:, None], [at.q[0]]
        if isinstance(motors, pk.capability.DistributedActuation):
            parts.append(at.front[0] / motors.rod)
            speeds = problem.slider_speeds(at, gravity_torques(problem.arm, at.q))[0]
        fastest = np.stack([curve.fastest for curve in motors.curves])
        sizes = [SIZES[quantity] for quantity in self.quantities]
        return np.concatenate([*parts, (speeds / fastest).ravel(), at.values[0] / sizes])


@cache
def posture_program(
    mechanism: str, quantities: tuple[Quantity, ...] = ("velocity",), tolerance: float = 1e-10, **settings: float
) -> PostureProgram:
    """Return the program of "JAM" or "DAM", Equation 1 with one quantity, built once for all places and directions."""
    motors: Any = actuation_of(mechanism)
    kinds, speeds, sliding = len(motors.curves), quantities.count("velocity"), mechanism == "DAM"
    q, front, values = ca.SX.sym("q", JOINTS), ca.SX.sym("front", JOINTS * sliding), ca.SX.sym("v", len(quantities))
    shares, position, least = ca.SX.sym("shares", JOINTS * kinds * speeds), ca.SX.sym("position", 2), ca.SX.sym("least")
    ways = ca.SX.sym("ways", 2, len(quantities))
    place, columns, load = linkage(q)
    equal, rows, gears = [(place[a] - position[a]) / LENGTHS[0] for a in range(2)], list[Any](), list[list[Any]]()
    for j in range(JOINTS):
        _, places, ratios = transmission(motors, j, q[j], front[j] if sliding else None)
        gears.append(ratios)
        if sliding:
            low, high = motors.back_bounds[j]
            rows += [(places[1] - low) / motors.rod[j], (high - places[1]) / motors.rod[j]]
    blocks = iter(ca.vertsplit(shares, JOINTS * kinds) if speeds else ())
    for k, quantity in enumerate(quantities):
        if quantity == "force":
            push = [SIZES[quantity] * values[k] * sum(columns[j][a] * ways[a, k] for a in range(2)) for j in range(3)]
            for j in range(JOINTS):
                for gear, curve in zip(gears[j], motors.curves, strict=True):
                    efforts = gear * load[j], gear * (load[j] + push[j])
                    rows += [1 + sign * effort / curve.stall[j] for effort in efforts for sign in (-1.0, 1.0)]
            continue
        block, rates = next(blocks), [ca.SX(0)] * JOINTS
        for n, curve in enumerate(motors.curves):
            for j in range(JOINTS):
                rates[j] += gears[j][n] * curve.fastest[j] * block[n * JOINTS + j]
                rows += diamond(gears[j][n] * load[j] / curve.stall[j], block[n * JOINTS + j])
        moved = [sum(columns[j][a] * rates[j] for j in range(JOINTS)) / SIZES[quantity] for a in range(2)]
        equal += [moved[a] - values[k] * ways[a, k] for a in range(2)]
    if len(quantities) > 1:
        rows.append(values[0] - least)
    ends = [(-np.inf, np.inf)] * JOINTS
    if sliding:
        ends = [(zero + low, zero + np.pi - low) for zero, low in zip(motors.zero, motors.least_angle, strict=True)]
        ends += [tuple(pair / rod) for pair, rod in zip(motors.front_bounds, motors.rod, strict=True)]
    ends += [(-1.0, 1.0)] * shares.numel() + [(0.0, np.inf)] * len(quantities)
    program = {
        "x": ca.vertcat(q, front, shares, values),
        "p": ca.vertcat(position, ca.vec(ways), least),
        "f": -values[-1],
        "g": ca.vertcat(*equal, *rows),
    }
    return PostureProgram(
        mechanism=Mechanism(arm=pk.arms.kim_3r(), actuation=motors),
        quantities=quantities,
        solver=ipopt(program, tolerance, **settings),
        lower=np.array(ends)[:, 0],
        upper=np.array(ends)[:, 1],
        highest=np.repeat([0.0, np.inf], [len(equal), len(rows)]),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProgram:
    """The least ``weights`` · (duration [s], energy [J]) of motions with at most a given duration.

    Unknowns: coefficients of joints, and of front sliders [rods' lengths], intervals, and the work of every motor.
    """

    problem: pk.PointToPoint
    solver: Any
    highest: Float[np.ndarray, " rows"]
    values: Any

    def solved(
        self, start: np.ndarray, weights: tuple[float, float], longest: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return the unknowns found, their duration [s] and energy [J], and whether IPOPT ended at an optimum."""
        lower, upper = np.append(np.zeros(len(self.highest)), -np.inf), np.append(self.highest, longest)
        solution = self.solver(x0=start, p=np.array(weights), lbg=lower, ubg=upper)
        z = np.array(solution["x"])[:, 0]
        return z, np.array(self.values(z))[:, 0], succeeded(self.solver)

    def start(self, genes: np.ndarray) -> np.ndarray:
        """Return the unknowns of genes (n_var,)."""
        q, front, _ = self.problem.profiles(genes[None])
        motors: Any = self.problem.actuation
        timing, sliding = self.problem.timing(genes[None]), isinstance(motors, pk.capability.DistributedActuation)
        parts = [q, *([front / motors.rod] if sliding else []), timing.intervals / STEP, timing.work / WORK]
        return np.concatenate([part.ravel() for part in parts])


def motion_program(problem: pk.PointToPoint, tolerance: float = 1e-8) -> MotionProgram:
    """Return the program of a problem with the paper's arm and diamonds, for IPOPT with a tolerance."""
    motors: Any = problem.actuation
    spline = problem.initial_paths.spline
    samples, coefficients = spline.shape
    sliding, kinds = isinstance(motors, pk.capability.DistributedActuation), len(motors.curves)
    q, front = ca.SX.sym("q", JOINTS, coefficients), ca.SX.sym("front", JOINTS * sliding, coefficients)
    steps, work = ca.SX.sym("steps", samples - 1), ca.SX.sym("work", JOINTS * kinds, samples - 1)
    moved, slid = q @ ca.DM(spline).T, front @ ca.DM(spline).T
    equal = [
        (linkage(moved[:, k])[0][a] - place[a]) / LENGTHS[0]
        for k, place in ((0, problem.start), (samples - 1, problem.target))
        for a in range(2)
    ]
    rows = list[Any]()
    for k in range(samples):  # sliders are within their bounds, and motors hold the arm still
        load = linkage(moved[:, k])[2]
        for j in range(JOINTS):
            angle, places, gears = transmission(motors, j, moved[j, k], slid[j, k] if sliding else None)
            rows += within_bounds(motors, j, angle, places) if sliding else []
            for gear, curve in zip(gears, motors.curves, strict=True):
                rows += [1 + sign * gear * load[j] / curve.stall[j] for sign in (-1.0, 1.0)]
    for k in range(samples - 1):  # motors are within their diamonds between samples, and their work is above either way
        load = linkage((moved[:, k] + moved[:, k + 1]) / 2)[2]
        rows.append(steps[k])
        for j in range(JOINTS):
            ends = [transmission(motors, j, moved[j, i], slid[j, i] if sliding else None)[1] for i in (k, k + 1)]
            ways = [last - first for first, last in zip(*ends, strict=True)] or [moved[j, k + 1] - moved[j, k]]
            middle = [(each[j, k] + each[j, k + 1]) / 2 if each.numel() else None for each in (moved, slid)]
            gears = transmission(motors, j, *middle)[2]
            for n, (gear, way, curve) in enumerate(zip(gears, ways, motors.curves, strict=True)):
                effort = gear * load[j]
                rows += diamond(effort / curve.stall[j] * steps[k], way / (curve.fastest[j] * STEP), steps[k])
                rows += [work[n * JOINTS + j, k] - sign * effort * way / WORK for sign in (-1.0, 1.0)]
    weights = ca.SX.sym("weights", 2)
    duration, energy = STEP * ca.sum1(steps), WORK * ca.sum1(ca.vec(work))
    unknowns, cost = ca.vertcat(ca.vec(q), ca.vec(front), steps, ca.vec(work)), weights[0] * duration
    program = {"x": unknowns, "p": weights, "f": cost + weights[1] * energy, "g": ca.vertcat(*equal, *rows, duration)}
    return MotionProgram(
        problem=problem,
        solver=ipopt(program, tolerance, max_iter=1000, bound_relax_factor=0.0),
        highest=np.repeat([0.0, np.inf], [len(equal), len(rows)]),
        values=ca.Function("values", [unknowns], [ca.vertcat(duration, energy)]),
    )


@dataclass(kw_only=True, eq=False)
class LookingAhead:
    """A step of time-optimal control: Eq. 6 with a common interval, from the last solution's multipliers.

    Unknowns: the points between the first and the last, then the time.
    """

    solver: Any
    lower: Float[np.ndarray, " unknowns"]
    upper: Float[np.ndarray, " unknowns"]
    multipliers: tuple[Any, Any] | None = None

    def solved(self, points: Float[np.ndarray, "points 2"], time: float) -> tuple[float, bool]:
        """Return the time [s] from the first point to the last, and whether the solver ended at an optimum."""
        scaled = points / LENGTH
        start, ends = np.append(scaled[1:-1].ravel(), time), np.concatenate([scaled[0], scaled[-1]])
        known = {} if self.multipliers is None else dict(zip(("lam_x0", "lam_g0"), self.multipliers, strict=True))
        solution = self.solver(x0=start, p=ends, lbx=self.lower, ubx=self.upper, lbg=0.0, ubg=np.inf, **known)
        self.multipliers = solution["lam_x"], solution["lam_g"]
        return float(solution["f"]), bool(self.solver.stats()["success"])


def looking_ahead(model: PolynomialEllipsoids, pieces: int) -> LookingAhead:
    """Return the program of a number of pieces, built once."""
    inner, ends, time = ca.SX.sym("inner", 2, pieces - 1), ca.SX.sym("ends", 4), ca.SX.sym("time")
    points, rows = ca.horzcat(ends[:2], inner, ends[2:]), list[Any]()
    for k in range(pieces):  # interval² − ‖R dp‖², points in ``LENGTH``
        point, step = points[:, k], points[:, k + 1] - points[:, k]
        took = root(model.polynomials, LENGTH * (point + step / 2)) @ (LENGTH * step)
        rows.append((time / pieces) ** 2 - ca.sumsqr(took))
    program = {"x": ca.vertcat(ca.vec(inner), time), "p": ends, "f": time, "g": ca.vertcat(*rows)}
    pushes = dict.fromkeys((f"warm_start_{what}_push" for what in ("bound", "mult_bound", "slack_bound")), 1e-9)
    return LookingAhead(
        solver=ipopt(program, 1e-8, warm_start_init_point="yes", mu_init=1e-7, **pushes),
        lower=np.append(np.tile(model.lower / LENGTH, pieces - 1), 1e-6),
        upper=np.append(np.tile(model.upper / LENGTH, pieces - 1), np.inf),
    )


def root(polynomials: Any, position: Any) -> Any:
    """Return R = Q^(1/2) / s in closed form, log s and Q's entries polynomials of degree 2 of the position."""
    x = [1.0, *[(position[a] - polynomials.center[a]) / polynomials.scale for a in range(2)]]
    products = [x[i] * x[j] for i in range(3) for j in range(i, 3)]
    log_scale, first, mixed, last = (
        sum(float(c) * product for c, product in zip(column, products, strict=True))
        for column in polynomials.coefficients.T
    )
    delta = ca.sqrt(first * last - mixed**2)
    over = 1 / (ca.exp(log_scale) * ca.sqrt(first + last + 2 * delta))
    return over * ca.vertcat(ca.horzcat(first + delta, mixed), ca.horzcat(mixed, last + delta))
