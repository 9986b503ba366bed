"""The front of ``energy_torque`` by CasADi and IPOPT: ``python -m studies.benchmarks.reference_front``.

Every start is solved for each objective alone. ε-constraints (inequalities, on either objective) then follow every
branch both ways, each level from the best distinct motions of its neighbour. ``--write`` stores the front.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import moocore
import numpy as np

from studies.benchmarks.reference_program import (
    BEGIN,
    FITTED,
    LENGTHS,
    POSITION,
    Array,
    Optimum,
    Program,
    build,
    kinematics,
    optimise,
)
from studies.reporting import REPORTED, Row, report, study_parser

REFERENCE_POINT = np.array([0.065, 0.10])
ENERGY, TORQUE = 0, 1
NAMES, UNITS = ("kinetic energy", "torque norm"), ("J s", "N²m²s")
TABLE = "energy_torque reference front"
REFERENCE = REPORTED / "energy_torque_reference.csv"


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


def distinct_optima(optima: Iterable[Optimum | None], objective: int, count: int) -> list[Optimum]:
    """Return the best optima by one objective, any two more than a milliradian (root mean square) apart."""
    chosen: list[Optimum] = []
    for one in sorted((o for o in optima if o is not None), key=lambda o: float(o.F[objective])):
        if len(chosen) < count and all(np.sqrt(np.mean((one.q - other.q) ** 2)) > 1e-3 for other in chosen):
            chosen.append(one)
    return chosen


def lexicographic(program: Program, best: Optimum, objective: int) -> Optimum:
    """Return the end of the front next to an objective's optimum: the other one at a loss of one part in a million."""
    ceilings = np.full(2, np.inf)
    ceilings[objective] = best.F[objective] * (1 + 1e-6)
    other = 1 - objective
    optima = [optimise(program, start, other, ceilings) for start in (best, best.q)]
    return distinct_optima([best, *optima], other, 1)[0]


def follow_ceilings(program: Program, seeds: Sequence[Optimum], objective: int, levels: Array) -> list[Optimum]:
    """Return optima of one objective under each ceiling on the other, swept both ways until no level improves.

    A level starts from the best distinct motions of the last level, and at first cold from the seeds, which bring in
    branches that appear halfway.
    """
    pools: list[list[Optimum]] = [[] for _ in levels]
    order = range(len(levels))
    before = np.inf
    for _ in range(6):
        neighbours: list[Optimum] = []
        for level in order:
            ceilings = np.full(2, np.inf)
            ceilings[1 - objective] = levels[level]
            optima = [
                optimise(program, one, objective, ceilings) or optimise(program, one.q, objective, ceilings)
                for one in neighbours
            ]
            if not pools[level]:
                optima += [optimise(program, seed.q, objective, ceilings) for seed in seeds]
            neighbours = pools[level] = distinct_optima([*pools[level], *optima], objective, 4)
        total = sum(float(pool[0].F[objective]) for pool in pools if pool)
        if total > before - 1e-9:
            break
        before, order = total, order[::-1]
    return [one for pool in pools for one in pool]


def single_optima(program: Program, starts: int, seed: int) -> tuple[list[Optimum], list[Optimum]]:
    """Return the distinct optima of each objective, from the starts that exceed the joint limits least."""
    tracks = candidates(program, 2 * starts, np.random.default_rng(seed))
    tracks.sort(key=lambda q: float(np.max(np.abs(q) - POSITION)))
    energies, torques = (
        distinct_optima((optimise(program, q, objective) for q in tracks[:starts]), objective, 8)
        for objective in (ENERGY, TORQUE)
    )
    return energies, torques


def reference_front(program: Program, starts: int, levels: int, seed: int) -> tuple[list[Optimum], list[Optimum]]:
    """Return the non-dominated optima, sorted by kinetic energy, and both ends of the front."""
    energies, torques = single_optima(program, starts, seed)
    ends = [lexicographic(program, energies[0], ENERGY), lexicographic(program, torques[0], TORQUE)]
    optima = [*energies, *torques, *ends]
    for objective in (TORQUE, ENERGY):
        ceiling = 1 - objective
        grid = np.linspace(ends[0].F[ceiling], ends[1].F[ceiling], levels + 2)[1:-1]
        optima += follow_ceilings(program, [*energies, *torques], objective, grid)
    # the same motion from two sides differs in the tenth decimal
    F = np.round([one.F for one in optima], 9)
    unique = np.unique(F, axis=0, return_index=True)[1]
    front = unique[moocore.is_nondominated(F[unique])]
    return [optima[i] for i in front], ends


def published_rows(starts: int, seed: int) -> list[Row]:
    """Return simulations 1 to 3 with the fitted masses and Table 5, to show that this is the paper's problem."""
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
        Row(table=table, row=row, column=column, unit=unit, ours=float(value), reference=theirs)
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
    """Compute the front, print its ends, size and hypervolume, and write the files asked for."""
    parser = study_parser(
        "The energy_torque front by ε-constraints with CasADi and IPOPT.",
        quick="fewer starts and levels, no simulations of the paper",
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help=f"write the front to {REFERENCE.name}")
    options = parser.parse_args(arguments)
    starts, levels = (12, 10) if options.quick else (48, 100)
    begin = time.perf_counter()
    front, ends = reference_front(build(101), starts, levels, options.seed)
    taken = Row(table=TABLE, row="front", column="time", unit="s", ours=time.perf_counter() - begin)
    rows = [*front_rows(front, ends), taken, *([] if options.quick else published_rows(starts, options.seed))]
    if options.write:
        write_front(front, REFERENCE)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
