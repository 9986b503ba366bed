"""The front of ``energy_torque`` by CasADi and IPOPT: ``python -m studies.benchmarks.reference_front``.

The problem of Tringali and Cocuzza (2020), section 4: a planar 3R arm follows a line in one second within joint
position and velocity limits (their Table 2); the start posture and the final velocity are free. Nothing is shared with
paretoik: the dynamics are written in absolute link angles, the path is an equality at every sample.

Every start is solved for each objective alone; ε-constraints (inequalities, on either objective) then follow every
branch both ways, each level from the best distinct motions of its neighbour. ``--write`` stores the front.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import casadi
import moocore
import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.reporting import REPORTED, Row, report

Array: TypeAlias = NDArray[np.float64]

LENGTHS = np.array([0.176, 0.176, 0.1375])
CENTERS = np.array([0.0950, 0.0717, 0.0526])
INERTIAS = np.array([0.001811, 0.003173, 0.002103])
PRINTED = np.array([0.615, 0.615, 0.307])
FITTED = np.array([0.619, 0.821, 0.503])  # reproduces the published energies, unlike the printed masses
BEGIN, END, DURATION = np.array([0.4678, 0.0]), np.array([0.0983, 0.1526]), 1.0
POSITION, VELOCITY = np.deg2rad([90.0, 120.0, 120.0]), 3.8
REFERENCE_POINT = np.array([0.065, 0.10])
ENERGY, TORQUE = 0, 1
NAMES, UNITS = ("kinetic energy", "torque norm"), ("J s", "N²m²s")
TABLE = "energy_torque reference front"
REFERENCE = REPORTED / "energy_torque_reference.csv"


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
    given = {"lbx": program.lower, "ubx": program.upper, "lbg": program.lower_rows, "ubg": upper_rows}
    weights = np.eye(2)[objective]
    if isinstance(start, Optimum):
        lam_x, lam_g = start.multipliers
        solver, q = program.warm, start.q
        found = solver(x0=q.ravel(), p=weights, lam_x0=lam_x, lam_g0=lam_g, **given)
    else:
        solver = program.cold
        found = solver(x0=start.ravel(), p=weights, **given)
    rows = np.asarray(found["g"]).ravel()
    if not solver.stats()["success"] or max(np.max(rows - upper_rows), np.max(program.lower_rows - rows)) > 1e-8:
        return None
    q = np.asarray(found["x"]).reshape(-1, 3)
    multipliers = (np.asarray(found["lam_x"]).ravel(), np.asarray(found["lam_g"]).ravel())
    return Optimum(q=q, F=rows[-2:], multipliers=multipliers)


def kinematics(q: Array) -> tuple[Array, Array]:
    """Return tool points (..., 2) and Jacobians (..., 2, 3) of joint angles (..., 3)."""
    phi = np.cumsum(q, axis=-1)
    steps = np.stack([LENGTHS * np.cos(phi), LENGTHS * np.sin(phi)], axis=-2)
    reach = np.cumsum(steps[..., ::-1], axis=-1)[..., ::-1]
    return steps.sum(axis=-1), np.stack([-reach[..., 1, :], reach[..., 0, :]], axis=-2)


def start_postures(angles: Array) -> Array:
    """Return the postures (any, 3) that hold the path's first point, both elbows, for absolute tool angles."""
    wrist = BEGIN - LENGTHS[2] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    cosine = (np.sum(wrist**2, axis=-1) - LENGTHS[0] ** 2 - LENGTHS[1] ** 2) / (2 * LENGTHS[0] * LENGTHS[1])
    inside = np.abs(cosine) <= 1
    wrist, angles, elbow = wrist[inside], angles[inside], np.arccos(cosine[inside])
    postures = []
    for second in (elbow, -elbow):
        first = np.arctan2(wrist[:, 1], wrist[:, 0])
        first = first - np.arctan2(LENGTHS[1] * np.sin(second), LENGTHS[0] + LENGTHS[1] * np.cos(second))
        postures.append(np.stack([first, second, angles - first - second], axis=-1))
    return np.concatenate(postures)


def candidates(program: Program, count: int, rng: np.random.Generator) -> list[Array]:
    """Return joint angles (time, 3) on the path: weighted-pseudoinverse rollouts with a random self-motion drift."""
    postures = start_postures(rng.uniform(-0.5, 0.5, 4 * count))
    q = postures[rng.permutation(len(postures))[: 3 * count]]
    compliance = np.exp(rng.normal(0.0, 1.5, q.shape))[:, None, :]
    drift = rng.normal(0.0, 1.0, len(q)) / len(program.tool)
    motions = [q]
    for point in program.tool[1:]:
        # the signed minors of J span its null space and never flip
        q = q + drift[:, None] * np.cross(*np.moveaxis(kinematics(q)[1], -2, 0)) / np.prod(LENGTHS[:2])
        for _ in range(4):
            x, J = kinematics(q)
            W = J * compliance
            gram = W @ np.swapaxes(J, -1, -2) + 1e-9 * np.eye(2)
            q = q + (np.swapaxes(W, -1, -2) @ np.linalg.solve(gram, (point - x)[..., None]))[..., 0]
        motions.append(q)
    tracks = np.stack(motions, axis=1)
    error = np.abs(kinematics(tracks)[0] - program.tool).max(axis=(1, 2))
    sound = (error < 1e-6) & (np.abs(np.diff(tracks, axis=1)).max(axis=(1, 2)) < 0.5)
    return list(tracks[sound][:count])


def distinct(optima: Iterable[Optimum | None], objective: int, keep: int) -> list[Optimum]:
    """Return the best optima by one objective, no two within a milliradian (root mean square) of one another."""
    kept: list[Optimum] = []
    for one in sorted((o for o in optima if o is not None), key=lambda o: float(o.F[objective])):
        if len(kept) < keep and all(np.sqrt(np.mean((one.q - other.q) ** 2)) > 1e-3 for other in kept):
            kept.append(one)
    return kept


def lexicographic(program: Program, best: Optimum, objective: int) -> Optimum:
    """Return the end of the front next to an objective's optimum: the other one at a loss of one part in a million."""
    ceilings = np.full(2, np.inf)
    ceilings[objective] = best.F[objective] * (1 + 1e-6)
    other = 1 - objective
    found = [optimise(program, start, other, ceilings) for start in (best, best.q)]
    return distinct([best, *found], other, 1)[0]


def followed(program: Program, seeds: Sequence[Optimum], objective: int, levels: Array) -> list[Optimum]:
    """Return optima of one objective under each ceiling on the other, swept both ways until no level improves.

    A level starts from the best distinct motions of the level just left, and at first cold from the seeds, which bring
    in branches that appear halfway.
    """
    pools: list[list[Optimum]] = [[] for _ in levels]
    order = range(len(levels))
    before = np.inf
    for _ in range(6):
        neighbours: list[Optimum] = []
        for level in order:
            ceilings = np.full(2, np.inf)
            ceilings[1 - objective] = levels[level]
            found = [
                optimise(program, one, objective, ceilings) or optimise(program, one.q, objective, ceilings)
                for one in neighbours
            ]
            if not pools[level]:
                found += [optimise(program, seed.q, objective, ceilings) for seed in seeds]
            neighbours = pools[level] = distinct([*pools[level], *found], objective, 4)
        total = sum(float(pool[0].F[objective]) for pool in pools if pool)
        if total > before - 1e-9:
            break
        before, order = total, order[::-1]
    return [one for pool in pools for one in pool]


def single_optima(program: Program, starts: int, seed: int) -> tuple[list[Optimum], list[Optimum]]:
    """Return the distinct optima of each objective, from the starts that leave the joint limits least."""
    tracks = candidates(program, 2 * starts, np.random.default_rng(seed))
    tracks.sort(key=lambda q: float(np.max(np.abs(q) - POSITION)))
    energies, torques = (
        distinct((optimise(program, q, objective) for q in tracks[:starts]), objective, 8)
        for objective in (ENERGY, TORQUE)
    )
    return energies, torques


def reference_front(program: Program, starts: int, levels: int, seed: int) -> tuple[list[Optimum], list[Optimum]]:
    """Return the non-dominated optima, sorted by kinetic energy, and both ends of the front."""
    energies, torques = single_optima(program, starts, seed)
    ends = [lexicographic(program, energies[0], ENERGY), lexicographic(program, torques[0], TORQUE)]
    found = [*energies, *torques, *ends]
    for objective in (TORQUE, ENERGY):
        ceiling = 1 - objective
        grid = np.linspace(ends[0].F[ceiling], ends[1].F[ceiling], levels + 2)[1:-1]
        found += followed(program, [*energies, *torques], objective, grid)
    # the same motion from two sides differs in the tenth decimal
    F = np.round([one.F for one in found], 9)
    unique = np.unique(F, axis=0, return_index=True)[1]
    front = unique[moocore.is_nondominated(F[unique])]
    return [found[i] for i in front], ends


def published(starts: int, seed: int) -> list[Row]:
    """Return simulations 1 to 3 with the fitted masses beside Table 5, to see that this is the paper's problem."""
    programs = {limited: build(101, FITTED, limited=limited) for limited in (False, True)}
    optima = {limited: single_optima(program, starts, seed) for limited, program in programs.items()}
    paper = [(False, ENERGY, (0.0528, 0.1827)), (True, ENERGY, (0.0528, 0.1820)), (True, TORQUE, (0.0795, 0.0912))]
    rows = []
    for number, (limited, objective, values) in enumerate(paper, start=1):
        best = optima[limited][objective][0]
        rows += rows_of("Tringali 2020, Table 5 (fitted masses)", f"simulation {number}", best, values)
    return rows


def rows_of(table: str, row: str, one: Optimum, paper: Sequence[float | None] = (None, None)) -> list[Row]:
    """Return both objectives of a motion as rows."""
    return [
        Row(table=table, row=row, column=column, unit=unit, ours=float(value), paper=theirs)
        for column, unit, value, theirs in zip(NAMES, UNITS, one.F, paper, strict=True)
    ]


def front_rows(front: Sequence[Optimum], ends: Sequence[Optimum]) -> list[Row]:
    """Return the front's size, hypervolume and ends as rows."""
    volume = float(moocore.hypervolume(np.array([one.F for one in front]), ref=REFERENCE_POINT))
    return [
        Row(table=TABLE, row="front", column="points", unit="", ours=len(front)),
        Row(table=TABLE, row="front", column="hypervolume", unit="N²m²s J s", ours=volume, note="to (0.065, 0.10)"),
        *rows_of(TABLE, "least kinetic energy", ends[ENERGY]),
        *rows_of(TABLE, "least torque norm", ends[TORQUE]),
    ]


def write_front(front: Sequence[Optimum], file: Path) -> None:
    """Write both objectives of every point as CSV."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["kinetic_energy", "torque_norm"])
        writer.writerows([f"{value:.9f}" for value in one.F] for one in front)


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute the front, print its ends, size and hypervolume, and write what is asked for."""
    parser = argparse.ArgumentParser(description="The energy_torque front by ε-constraints with CasADi and IPOPT.")
    parser.add_argument("--quick", action="store_true", help="fewer starts and levels, no simulations of the paper")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    parser.add_argument("--write", action="store_true", help=f"write the front to {REFERENCE.name}")
    given = parser.parse_args(arguments)
    starts, levels = (12, 10) if given.quick else (48, 100)
    begin = time.perf_counter()
    front, ends = reference_front(build(101), starts, levels, given.seed)
    taken = Row(table=TABLE, row="front", column="time", unit="s", ours=time.perf_counter() - begin)
    rows = [*front_rows(front, ends), taken, *([] if given.quick else published(starts, given.seed))]
    if given.write:
        write_front(front, REFERENCE)
    report(rows, json_file=given.json)


if __name__ == "__main__":
    main()
