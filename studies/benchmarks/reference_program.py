"""The energy-torque problem of Tringali and Cocuzza (2020), section 4, as a program of CasADi for IPOPT.

A planar 3R arm follows a line in one second within joint position and velocity limits (their Table 2); the start
posture and the final velocity are free. It shares nothing with paretoik: the dynamics are written in absolute link
angles, the path is an equality at every sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]

LENGTHS = np.array([0.176, 0.176, 0.1375])
CENTERS = np.array([0.0950, 0.0717, 0.0526])
INERTIAS = np.array([0.001811, 0.003173, 0.002103])
PRINTED = np.array([0.615, 0.615, 0.307])
FITTED = np.array([0.619, 0.821, 0.503])  # reproduces the published energies, unlike the printed masses
BEGIN, END, DURATION = np.array([0.4678, 0.0]), np.array([0.0983, 0.1526]), 1.0
POSITION, VELOCITY = np.deg2rad([90.0, 120.0, 120.0]), 3.8


@dataclass(frozen=True, kw_only=True)
class Program:
    """The nonlinear program at one number of samples: a solver for cold starts, one for warm ones, and its bounds."""

    cold: Any
    warm: Any
    tool: Array
    lower: Array
    upper: Array
    lower_rows: Array
    upper_rows: Array


@dataclass(frozen=True, kw_only=True)
class Optimum:
    """A local optimum: joint angles (time, 3) [rad], kinetic energy [J s] and torque norm [N²m²s], multipliers."""

    q: Array
    F: Array
    multipliers: tuple[Array, Array]


def tool_path(samples: int) -> Array:
    """Return the line's points (time, 2) [m] under Eq. 19 read as s(t), with its lost factor of one half."""
    t = np.linspace(0.0, DURATION, samples)
    half, omega = DURATION / 2, 4 * np.pi / DURATION
    early = np.minimum(t, DURATION - t)
    share = (early**2 / 2 + (np.cos(omega * early) - 1) / omega**2) / half**2
    share = np.where(t <= half, share, 1 - share)
    points: Array = BEGIN + share[:, None] * (END - BEGIN)
    return points


def coupling(masses: Array) -> Array:
    """Return the symmetric A with M_ij = A_ij cos(φ_i - φ_j) in absolute link angles φ [kg m²]."""
    outer = np.append(np.cumsum(masses[::-1])[::-1][1:], 0.0)
    moment = masses * CENTERS + outer * LENGTHS
    upper = np.triu(np.outer(LENGTHS, moment), 1)
    A: Array = upper + upper.T + np.diag(INERTIAS + masses * CENTERS**2 + outer * LENGTHS**2)
    return A


def integrals(q: Any, masses: Array, dt: float) -> Any:
    """Return both objectives of symbolic joint angles (3, time): backward differences from rest, rectangle sum."""
    A = coupling(masses)
    phi = casadi.cumsum(q, 0)
    velocity = casadi.horzcat(casadi.SX.zeros(3, 1), (phi[:, 1:] - phi[:, :-1]) / dt)
    acceleration = (velocity[:, 1:] - velocity[:, :-1]) / dt
    phi, velocity = phi[:, 1:], velocity[:, 1:]
    energy, forces = 0, []
    for i in range(3):
        force = 0
        for j in range(3):
            angle = phi[i, :] - phi[j, :]
            # generalised force on φ_i: Σ_j A_ij (φ̈_j cos φ_ij + φ̇_j² sin φ_ij)
            force += A[i, j] * (acceleration[j, :] * casadi.cos(angle) + velocity[j, :] ** 2 * casadi.sin(angle))
            energy += A[i, j] / 2 * casadi.sum2(velocity[i, :] * velocity[j, :] * casadi.cos(angle))
        forces.append(force)
    torques = [forces[0] + forces[1] + forces[2], forces[1] + forces[2], forces[2]]
    return casadi.vertcat(energy * dt, sum(casadi.sumsqr(torque) for torque in torques) * dt)


def build(samples: int, masses: Array = PRINTED, *, limited: bool = True) -> Program:
    """Return the program whose rows are the path, the joint velocities and the two objectives."""
    dt = DURATION / (samples - 1)
    q, weights = casadi.SX.sym("q", 3, samples), casadi.SX.sym("weights", 2)
    phi = casadi.cumsum(q, 0)
    tool = casadi.vertcat(LENGTHS[None] @ casadi.cos(phi), LENGTHS[None] @ casadi.sin(phi))
    F = integrals(q, masses, dt)
    rows = casadi.vertcat(casadi.vec(tool), casadi.vec(q[:, 1:] - q[:, :-1]) / dt, F)
    problem = {"x": casadi.vec(q), "p": weights, "f": 10 * casadi.dot(weights, F), "g": rows}
    common: dict[str, Any] = {"print_level": 0, "sb": "yes", "max_iter": 300, "tol": 1e-9, "bound_relax_factor": 0.0}
    # a warm start that is pushed off its bounds drifts to a worse branch
    pushes = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
    warm = common | {"warm_start_init_point": "yes", "mu_init": 1e-6} | {f"warm_start_{name}": 1e-9 for name in pushes}
    solvers = [
        casadi.nlpsol(name, "ipopt", problem, {"print_time": False, "error_on_fail": False, "ipopt": options})
        for name, options in (("cold", common | {"mu_init": 1e-2}), ("warm", warm))
    ]
    x = tool_path(samples)
    speed = np.full(3 * (samples - 1), VELOCITY if limited else np.inf)
    bound = np.tile(POSITION if limited else np.full(3, np.inf), samples)
    return Program(
        cold=solvers[0],
        warm=solvers[1],
        tool=x,
        lower=-bound,
        upper=bound,
        lower_rows=np.concatenate([x.ravel(), -speed, [-np.inf, -np.inf]]),
        upper_rows=np.concatenate([x.ravel(), speed, [np.inf, np.inf]]),
    )


def optimise(
    program: Program, start: Array | Optimum, objective: int, ceilings: ArrayLike = (np.inf, np.inf)
) -> Optimum | None:
    """Return the optimum reached from joint angles (cold) or from a neighbouring optimum (warm), None on failure."""
    upper_rows = program.upper_rows.copy()
    upper_rows[-2:] = ceilings
    bounds = {"lbx": program.lower, "ubx": program.upper, "lbg": program.lower_rows, "ubg": upper_rows}
    weights = np.eye(2)[objective]
    if isinstance(start, Optimum):
        lam_x, lam_g = start.multipliers
        solver, q = program.warm, start.q
        end = solver(x0=q.ravel(), p=weights, lam_x0=lam_x, lam_g0=lam_g, **bounds)
    else:
        solver = program.cold
        end = solver(x0=start.ravel(), p=weights, **bounds)
    rows = np.asarray(end["g"]).ravel()
    if not solver.stats()["success"] or max(np.max(rows - upper_rows), np.max(program.lower_rows - rows)) > 1e-8:
        return None
    q = np.asarray(end["x"]).reshape(-1, 3)
    multipliers = (np.asarray(end["lam_x"]).ravel(), np.asarray(end["lam_g"]).ravel())
    return Optimum(q=q, F=rows[-2:], multipliers=multipliers)


def kinematics(q: Array) -> tuple[Array, Array]:
    """Return tool points (..., 2) and Jacobians (..., 2, 3) of joint angles (..., 3)."""
    phi = np.cumsum(q, axis=-1)
    steps = np.stack([LENGTHS * np.cos(phi), LENGTHS * np.sin(phi)], axis=-2)
    reach = np.cumsum(steps[..., ::-1], axis=-1)[..., ::-1]
    return steps.sum(axis=-1), np.stack([-reach[..., 1, :], reach[..., 0, :]], axis=-2)
