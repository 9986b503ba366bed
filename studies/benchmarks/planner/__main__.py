"""The planner against CasADi + FATROP and CasADi + IPOPT; losses first.

    python -m studies.benchmarks.planner [--quick] [--seed N] [--json FILE]

Simulations 1 to 5 of Tringali & Cocuzza 2020 and the energy-torque front in one run: the same discretisation, starts
and levels, ours and theirs alternating, medians of repeats. FATROP gets optimal control, IPOPT joint angles only; both
get lean closed-form dynamics, an iteration cap, the first barrier that serves them best, and both cores, with CasADi's
own evaluation and compiled. Their time to the best optimum is the expected one of independent starts: the time of all,
shared by both cores, divided by the number that ends there. Ours is a whole ``plan``; a first one, which compiles, is
not timed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from studies.benchmarks.peers.solvers import COMPILER
from studies.benchmarks.planner.questions import Cores
from studies.benchmarks.planner.simulations import NAMES, Effort, SimulationResult, compare_simulation, forms, sum_rows
from studies.benchmarks.planner.sweep import sweeps
from studies.reporting import Row, losses_first, report, study_parser, tell


def simulation_rows(cores: Cores, arms: Sequence[str], effort: Effort, folder: Path) -> list[Row]:
    """Return the rows of all simulations on all arms."""
    rows: list[Row] = []
    each: dict[str, list[SimulationResult]] = {arm: [] for arm in arms}
    for name in NAMES:
        tell(f"{name}: peers")
        peers = forms(cores, name, arms, effort, folder)
        for arm in arms:
            tell(f"{name}, {arm}: side by side")
            each[arm].append(compare_simulation(cores, name, arm, peers[arm], effort))
            rows += each[arm][-1].rows
    return [row for arm in arms for row in sum_rows(arm, each[arm])] + rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="12 starts, the arm as printed, short sweeps")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if COMPILER is None:
        tell("no C compiler: peers run only with CasADi's own evaluation")
    effort = Effort(starts=12, repeats=1, seed=options.seed) if options.quick else Effort(seed=options.seed)
    arms = ("printed",) if options.quick else ("printed", "fitted")
    with tempfile.TemporaryDirectory() as folder, Cores() as cores:
        rows = simulation_rows(cores, arms, effort, Path(folder))
        rows += sweeps(cores, Path(folder), effort, quick=options.quick)
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
