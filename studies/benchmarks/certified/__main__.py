"""Tests of certified fronts; losses first.

    python -m studies.benchmarks.certified [--quick] [--problems NAME ...] [--seed N] [--json FILE]

Rows of a front of ``pk.epsilon_front``: the certificates' statements; the values by Pinocchio; what IPOPT and random
feasible steps find that is better than a point; exchange rates compared with differences of neighbouring ε-solves.
IPOPT starts from every point and minimises each objective below the point's own values of the others. Only our exact
functions of the motion that it returns, led back to the path, count: limits satisfied to 1e-8, no objective risen. At
an end of a front a rise of 1e-8 buys 1e-4 elsewhere: if a ceiling slips, IPOPT runs again below a lower one.

Seconds: ours are a whole front divided by its points, after a first one that compiles. The peers solve the same
ε-problems, each from the nearest other point of our front; their programs' making and compiling is not counted.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from paretoik.errors import ParetoikError
from studies.benchmarks.certified.attacks import (
    exchange_rows,
    ipopt_rows,
    led_back,
    objectives,
    perturbation_rows,
    violation,
)
from studies.benchmarks.certified.cases import CASES, HOLDS, Case, Subject, certificate_rows, subject_of
from studies.benchmarks.peers.solvers import COLD, COMPILER, WARM, Peer
from studies.reporting import Row, goal_row, losses_first, report, study_parser, tell, versus

REACHED = 1e-6  # of the ranges: a result this near our point, or better, has reached it
GOAL = 1.0
QUICK = {"energy_torque": 6, "Panda": 3}  # points
FEW = 3  # points of other problems with --quick
STEPS, QUICK_STEPS = 300, 60  # random steps from every point


class Solved(NamedTuple):
    """Seconds on one ε-problem, and whether it reached our point."""

    seconds: float
    reached: bool


def race_rows(subject: Subject) -> list[Row]:
    """Return our seconds per point compared with the peers'."""
    table, points, rows = subject.name, range(len(subject.q)), list[Row]()
    a_point, ours = "seconds a point", subject.seconds / len(points)
    peers = {"IPOPT": subject.peer} | ({"FATROP": subject.staged} if subject.staged is not None else {})
    for name, peer in peers.items():
        tries = [solve_epsilon(subject, point, peer) for point in points]
        reached, seconds = sum(one.reached for one in tries), [one.seconds for one in tries]
        middle, each = float(np.median(seconds)), sum(seconds) / reached if reached else np.inf
        note = f"{len(points)} points in {subject.seconds:.1f} s (processor {subject.cpu:.1f} s); {name} "
        note += f"{sum(seconds):.1f} s, reaches {reached} of them"
        rows += [
            versus(table, a_point, f"beside {name}'s median", "s", ours, middle, goal=GOAL, note=note),
            versus(table, a_point, f"beside {name}'s all over points reached", "s", ours, each, goal=GOAL, note=note),
        ]
    return rows


def solve_epsilon(subject: Subject, point: int, peer: Peer) -> Solved:
    """Return a peer's result on a point's ε-problem: from the nearest other point, twice if it fails."""
    shares, count = subject.values / subject.ranges, len(subject.ranges)
    distances = np.linalg.norm(shares - shares[point], axis=1)
    distances[point] = np.inf
    start, main = subject.q[int(distances.argmin())], int(subject.certificates.weights[point].argmax())
    ceilings = np.where(np.arange(count) == main, np.inf, subject.values[point])
    started, end = time.perf_counter(), None
    for settings in (WARM, COLD):
        end = peer.solve(start, main, ceilings, subject.ranges, settings).motion
        if end is not None:
            break
    seconds = time.perf_counter() - started
    motion = None if end is None else led_back(subject.task, end)
    if motion is None or violation(subject.task, motion) > HOLDS:
        return Solved(seconds, False)
    rise = (objectives(subject.task, motion) - subject.values[point]) / subject.ranges
    return Solved(seconds, bool(rise.max() <= REACHED))


def rows_of(case: Case, subject: Subject, *, quick: bool, seed: int) -> list[Row]:
    """Return all rows of a case's front."""
    rows, steps = certificate_rows(subject), QUICK_STEPS if quick else STEPS
    tell(f"{case.name}: IPOPT from {len(subject.q)} points")
    rows += ipopt_rows(subject, barriers=("low",) if quick else ("low", "high"))
    tell(f"{case.name}: {steps} random steps from each")
    rows += perturbation_rows(subject, steps=steps, seed=seed)
    tell(f"{case.name}: neighbouring ε-solves")
    rows += exchange_rows(subject)
    if case.raced:
        tell(f"{case.name}: the peers' sweeps")
        rows += race_rows(subject)
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="two problems, few points and steps")
    names = [case.name for case in CASES]
    parser.add_argument("--problems", nargs="+", choices=names, metavar="NAME", help="only these problems")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if COMPILER is None:
        tell("no C compiler: IPOPT and FATROP run with CasADi's own evaluation")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        chosen = options.problems or (list(QUICK) if options.quick else names)
        for case in (one for one in CASES if one.name in chosen):
            points = QUICK.get(case.name, FEW) if options.quick else case.points
            try:
                subject = subject_of(case, points=points, seed=options.seed, folder=Path(folder))
            except ParetoikError as error:
                rows.append(goal_row(case.name, "front", "failed", "", 1, 0, str(error)))
                continue
            rows += rows_of(case, subject, quick=options.quick, seed=options.seed)
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
