"""Random moves along certified fronts, with checks and comparisons with IPOPT and FATROP; losses first.

    python -m studies.benchmarks.navigation [--quick] [--moves N] [--seed S] [--problems NAME ...] [--json FILE]

Every move improves a random objective of a random point by 1 to 20 % of its range, at most up to the best value on the
front; one random objective pays, the others are held. A move is certified if its point has a residual of at most 1e-6
and satisfies its limits to 1e-8. It is best if no method, ours from every point of the front or a peer, found a payer
lower by more than 1e-5 of its range. Rates are those of a further move by 0.001 %, compared with the certificate's.
Peers start warm from the current point, and cold from a random point of the front. If there is a compiler they get
compiled code, except on the Panda, whose code takes minutes to compile: CasADi's interpreter. FATROP cannot state
cycles, and neither peer obstacles, directions or free paths. Times are processor time, ours with everything that is
followed and solved for a move. Predictions are those of moves that are followed: the time of all of ``Front.predict``,
and their error at the certified point, as the largest share of a range.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import paretoik as pk
from studies.benchmarks.navigation.cases import CASES, QUICK, peers_of
from studies.benchmarks.navigation.moves import OPTIONS, Tally, random_aim, rows_of, try_move
from studies.reporting import Row, report, study_parser, tell


def run_case(name: str, moves: int, seed: int, folder: Path) -> list[Row]:
    """Return the rows of a case after a number of random moves."""
    case, tally, rng = CASES[name], Tally(), np.random.default_rng(seed)
    tell(f"{name}: its front")
    problem = case.make()
    front = pk.epsilon_front(problem, points=case.points, starts=12, seed=0, observe=False)
    peers, bounds = peers_of(case, problem, folder), len(problem.program().upper)
    denser = front.refine_around(int(front.ids[len(front) // 2]), points=OPTIONS.around)  # this compiles, too
    tally.around = len(np.setdiff1d(denser.ids, front.ids))
    for i in range(moves):
        if i % 10 == 0:
            tell(f"{name}: move {i} of {moves}")
        row, aim = random_aim(front, bounds, rng)
        try_move(front, row, aim, peers, rng, tally)
    return rows_of(name, case, tally)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__, quick="the papers' arm alone, 12 moves")
    parser.add_argument("--moves", type=int, help="moves a problem (167: 1,000 in all; 12 with --quick)")
    parser.add_argument("--seed", type=int, default=0, help="of the moves (0)")
    parser.add_argument("--problems", nargs="+", choices=list(CASES), metavar="NAME", help="only these problems")
    options = parser.parse_args(arguments)
    moves = options.moves if options.moves is not None else 12 if options.quick else 167
    if moves < 1:
        parser.error(f"--moves must be at least 1, got {moves}")
    if options.seed < 0:
        parser.error(f"--seed must be at least 0, got {options.seed}")
    with tempfile.TemporaryDirectory() as folder:
        names = options.problems or (QUICK if options.quick else CASES)
        rows = [row for name in names for row in run_case(name, moves, options.seed, Path(folder))]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
