"""Tests of certified fronts; losses first.

    python -m studies.benchmarks.certified [--quick] [--problems NAME ...] [--seed N] [--json FILE]

``pk.epsilon_front`` is run on the energy-torque problem, on a planar 5R arm with two degrees of redundancy, on the
Panda across its table, by pose and by position only (four degrees of redundancy) within its own limits; and with a peak
by splines on the 3R arm. For every front the rows say: the certificates' statements; the values by Pinocchio; what
IPOPT and random feasible steps find that is better than a point; exchange rates compared with differences of
neighbouring ε-solves; and, on the Panda, seconds per point compared with IPOPT and FATROP.

IPOPT starts from every point and minimises each objective below the point's own values of the others, with its barrier
low and high. Only our exact functions of the motion that it returns, led back to the path, count: limits satisfied to
1e-8 (for splines between samples as well as the point itself does), and no objective risen at all. At an end of a front
a rise of 1e-8 buys 1e-4 elsewhere. If IPOPT's tolerance lets a ceiling slip, it therefore runs again below a ceiling
that is lower by as much. Notes say how far away the better motion is: certificates are local, and the optimum of
another basin may be better.

Seconds: ours are a whole ``epsilon_front`` divided by its points, after a first one that compiles. The peers solve only
the same ε-problems, each from the motion of the nearest other point of our front: IPOPT over joint positions, FATROP
over stages of postures and rates. They need no starts, and building and compiling their programs (-O2) is not counted.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from paretoik.errors import ParetoikError
from studies.benchmarks.certified.attacks import exchange_rows, ipopt_rows, perturbation_rows
from studies.benchmarks.certified.cases import CASES, Case, Subject, certificate_rows, goal_row, subject_of
from studies.benchmarks.certified.racing import race_rows
from studies.benchmarks.peers.solvers import COMPILER
from studies.reporting import Row, losses_first, report, study_parser, tell

QUICK = {"energy_torque": 6, "Panda": 3}  # points
FEW = 3  # points of other problems with --quick
STEPS, QUICK_STEPS = 300, 60  # random steps from every point


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
