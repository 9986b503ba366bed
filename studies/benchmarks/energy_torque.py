"""Distance of the search from the reference front: ``python -m studies.benchmarks.energy_torque``.

``problems/tringali_2020.py:energy_torque`` at the defaults of ``paretoik.solve``, one run per seed. The hypervolume
below the reference point (0.065, 0.10) is compared with that of the ε-constraint front by CasADi and IPOPT
(``studies/benchmarks/reference_front.py``). ``--ablate`` removes one ingredient of the search at a time.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import paretoik as pk
from paretoik.api.session import DEFAULTS
from paretoik.arrays import Objectives
from paretoik.front.indicators import hypervolume
from problems.tringali_2020 import energy_torque
from studies.processes import run_each, workers_of
from studies.reporting import REPORTED, Row, report, study_parser

REFERENCE_POINT = np.array([0.065, 0.10])
TABLE = "energy_torque against the IPOPT reference"
SHARE, GOAL, SHARE_GOAL, POINTS_GOAL = "median share of hypervolume", "beside the goal", 0.95, 50


def reference_front() -> np.ndarray:
    """Return the stored reference (points, 2): kinetic energy [J s], torque norm [N²m²s]."""
    with (REPORTED / "energy_torque_reference.csv").open() as file:
        return np.array([[float(row["kinetic_energy"]), float(row["torque_norm"])] for row in csv.DictReader(file)])


def variants(problem: pk.Tracking, *, ablate: bool) -> dict[str, pk.MaxiMinNSGA2 | None]:
    """Return the algorithms by name, None the problem's own; ``ablate`` adds those without one ingredient."""
    if not ablate:
        return {"defaults": None}
    mating = problem.algorithm(DEFAULTS.population).mating
    return {
        "defaults": None,
        "no infeasible parents": pk.MaxiMinNSGA2(
            DEFAULTS.population, crossover=mating.crossover, mutation=mating.mutation
        ),
        "SBX and polynomial mutation": pk.MaxiMinNSGA2(DEFAULTS.population, infeasible_share=0.3),
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Searched:
    """The front of a search, minimised, and its seconds."""

    F: Objectives
    seconds: float


def search(variant: str, seed: int, generations: int | None) -> Searched:
    """Search by one variant with a seed."""
    problem = energy_torque()
    algorithm, started = variants(problem, ablate=True)[variant], time.perf_counter()
    front = pk.solve(problem, algorithm=algorithm, seed=seed, generations=generations)
    return Searched(F=front.minimised, seconds=time.perf_counter() - started)


def variant_rows(variant: str, runs: Sequence[Searched]) -> list[Row]:
    """Return the medians of one variant over seeds, after printing every seed."""
    reference = hypervolume(reference_front(), REFERENCE_POINT)
    shares, points, seconds = [], [], []
    for seed, one in enumerate(runs):
        seconds.append(one.seconds)
        shares.append(hypervolume(one.F, REFERENCE_POINT) / reference)
        points.append(len(one.F))
        print(f"{variant}, seed {seed}: {shares[-1]:.4f} of the reference, {points[-1]} points, {seconds[-1]:.1f} s")
    share, spread = float(np.median(shares)), f"{GOAL}; {len(shares)} seeds, {min(shares):.3f} to {max(shares):.3f}"
    return [
        Row(
            table=TABLE,
            row=variant,
            column=SHARE,
            unit="",
            ours=share,
            reference=SHARE_GOAL,
            source="goal",
            note=spread,
        ),
        Row(
            table=TABLE,
            row=variant,
            column="least points",
            unit="",
            ours=min(points),
            reference=POINTS_GOAL,
            source="goal",
            note=GOAL,
        ),
        Row(table=TABLE, row=variant, column="median time", unit="s", ours=float(np.median(seconds))),
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve for every seed and report medians."""
    parser = study_parser(
        "The search at its defaults against the energy_torque reference.",
        quick="3 seeds, 100 generations",
        cluster="all searches",
    )
    parser.add_argument("--seeds", type=int, default=11)
    parser.add_argument("--ablate", action="store_true", help="also run without one ingredient of the search at a time")
    options = parser.parse_args(arguments)
    seeds, generations = (range(3), 100) if options.quick else (range(options.seeds), None)
    names = list(variants(energy_torque(), ablate=options.ablate))
    calls = {(name, f"seed {seed}"): partial(search, name, seed, generations) for name in names for seed in seeds}
    with workers_of(options.cluster) as executor:
        runs = run_each(executor, calls)
    rows = [row for name in names for row in variant_rows(name, [runs[name, f"seed {seed}"] for seed in seeds])]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    from studies.benchmarks.energy_torque import main as named_main  # workers know its functions by this name

    named_main()
