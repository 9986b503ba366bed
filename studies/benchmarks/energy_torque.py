"""How near the search alone comes to the reference: ``python -m studies.benchmarks.energy_torque``.

``problems/tringali_2020.py:energy_torque`` at the defaults of ``paretoik.solve``, one run a seed; hypervolume below the
reference point (0.065, 0.10) against that of the ε-constraint front of CasADi and IPOPT
(``studies/benchmarks/reference_front.py``). ``--ablate`` takes one ingredient of the search away at a time.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.front.indicators import hypervolume
from problems.tringali_2020 import energy_torque
from studies.reporting import REPORTED, Row, report

REFERENCE_POINT = np.array([0.065, 0.10])
GOAL = 0.95
TABLE = "energy_torque against the IPOPT reference"


def reference_front() -> np.ndarray:
    """Return the stored reference (points, 2): kinetic energy [J s], torque norm [N²m²s]."""
    with (REPORTED / "energy_torque_reference.csv").open() as file:
        return np.array([[float(row["kinetic_energy"]), float(row["torque_norm"])] for row in csv.DictReader(file)])


def main() -> None:
    """Solve for every seed and report medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=11)
    parser.add_argument("--quick", action="store_true", help="3 seeds, 100 generations")
    parser.add_argument("--ablate", action="store_true")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    seeds = range(3 if options.quick else options.seeds)
    generations = {"generations": 100} if options.quick else {}
    reference = hypervolume(reference_front(), REFERENCE_POINT)
    problem = energy_torque()
    variants = {"defaults": None}
    if options.ablate:
        variants |= {
            "no infeasible parents": pk.MaxiMinNSGA2(
                crossover=(suited := problem.algorithm(100)).mating.crossover, mutation=suited.mating.mutation
            ),
            "SBX and polynomial mutation": pk.MaxiMinNSGA2(infeasible_share=0.3),
        }
    rows = []
    for variant, algorithm in variants.items():
        shares, points, seconds = [], [], []
        for seed in seeds:
            started = time.perf_counter()
            front = pk.solve(problem, seed=seed, algorithm=algorithm, **generations)
            seconds.append(time.perf_counter() - started)
            shares.append(hypervolume(front.minimised, REFERENCE_POINT) / reference)
            points.append(len(front))
            print(
                f"{variant}, seed {seed}: {shares[-1]:.4f} of the reference, {points[-1]} points, {seconds[-1]:.1f} s"
            )
        note = f"{len(shares)} seeds, {min(shares):.3f} to {max(shares):.3f}"
        rows += [
            Row(table=TABLE, row=variant, column="median share of hypervolume", unit="", ours=float(np.median(shares)),
                paper=GOAL, note=note),
            Row(table=TABLE, row=variant, column="least points", unit="", ours=float(min(points)), paper=50.0),
            Row(table=TABLE, row=variant, column="median time", unit="s", ours=float(np.median(seconds))),
        ]  # fmt: skip
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
