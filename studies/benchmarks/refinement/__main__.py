"""Our solvers against others on the same programs, from the same starts; losses first.

    python -m studies.benchmarks.refinement [--quick] [--counts] [--time-left] [--cases NAME ...] [--json FILE]

A 3R arm and the Panda on their paths, 26 samples, with a smooth objective and with one that has kinks, and sliders from
point to point, 9 samples. Ours are the interior-point method, which smooths kinks, and SQP with a convex subproblem in
cvxpy: canonicalised once and run by Clarabel, or solved by cvxpy itself at every step (left out for sliders, a dense
program, where it takes minutes per start). SciPy's SLSQP and trust-constr get exact derivatives, trust-constr second
ones too; IPOPT and FATROP get compiled code if there is a compiler. Absolute values are slack variables for all of
them. Peers' unknowns are joint positions, FATROP's postures and rates in stages (it cannot state splines of sliders).
For sliders SciPy and IPOPT have our unknowns, functions and sparse derivatives, called from Python. Our exact functions
judge the results: a result counts if no limit and no equation is violated by more than 1e-6, and its solver reports
success.

Seconds are of the processor, those of all starts divided by the number that counts: failures cost too. Building
programs, compiling, and a first call are not counted. A peer's row is a loss if it takes less time than "auto", or
finds a value better by 1e-6 of the objective.

``--counts`` prints instead how often the default verbs canonicalise and run Clarabel, and the share of their time;
``--time-left`` prints how often the time left that verbs state is right within a factor of 2.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paretoik.runs.machine import single_blas_thread
from studies.benchmarks.refinement.cases import CASES, Contest, Solve
from studies.benchmarks.refinement.counts import count_rows, time_left_rows
from studies.reporting import LOSS, Row, losses_first, report, study_parser, tell, timed

VIOLATION = 1e-6
BETTER = 1e-6  # share of the objective
SECONDS, QUICK_SECONDS = 30.0, 10.0  # of SciPy's solvers, per start


@dataclass(frozen=True, kw_only=True, eq=False)
class Ends:
    """Objectives (starts,), NaN for failed starts, and processor seconds (starts,)."""

    objectives: np.ndarray
    seconds: np.ndarray

    @property
    def count(self) -> int:
        """Number of starts that count."""
        return int(np.isfinite(self.objectives).sum())

    @property
    def best(self) -> float:
        """The least objective; inf if no start counts."""
        return float(np.min(self.objectives, where=np.isfinite(self.objectives), initial=np.inf))

    @property
    def each(self) -> float:
        """Seconds of all starts, divided by the number that counts."""
        return float(self.seconds.sum() / self.count) if self.count else np.inf


def solve_all(solve: Solve, starts: np.ndarray) -> Ends:
    """Return the results of all starts, after a first call that is not counted."""
    solve(starts[0])
    objectives, seconds = np.full(len(starts), np.nan), np.zeros(len(starts))
    for i, start in enumerate(starts):
        end, _, seconds[i] = timed(lambda: solve(start))  # noqa: B023, called at once
        if end is not None and end[1] <= VIOLATION:
            objectives[i] = end[0]
    return Ends(objectives=objectives, seconds=seconds)


def tabulate(name: str, default: str, ends: dict[str, Ends]) -> list[Row]:
    """Return one row per solver of a case, that of "auto" first."""
    ours, rows = ends[default], list[Row]()
    for solver, end in ends.items():
        quicker = end.each < ours.each
        better = end.best < ours.best - BETTER * abs(ours.best)
        is_loss = solver != default and (quicker or better)
        outcome = (
            "no start counts" if not end.count else f"best {end.best:.8g}, median {np.nanmedian(end.objectives):.5g}"
        )
        ratio = "what auto takes" if solver == default else f"{end.each / ours.each:.3g} × what auto takes"
        counts = f"{end.count} of {len(end.objectives)} starts"
        note = (LOSS if is_loss else "") + "; ".join([ratio, counts, outcome])
        rows.append(Row(name, solver, "for each start that counts", "s", end.each, note=note))
    return rows


def contest_rows(name: str, contest: Contest) -> list[Row]:
    """Run a contest; return its rows."""
    ends = dict[str, Ends]()
    for solver, solve in contest.contestants.items():
        tell(f"{name}: {solver}")
        ends[solver] = solve_all(solve, contest.starts)
    return tabulate(name, contest.default, ends)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="two starts, 10 s each for SciPy")
    names = [case.name for case in CASES]
    parser.add_argument("--cases", nargs="+", choices=names, metavar="NAME", help="only these")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--counts", action="store_true", help="canonicalisations and Clarabel solves of default verbs")
    parser.add_argument("--time-left", action="store_true", help="stated time left against the true one")
    options = parser.parse_args(arguments)
    if options.counts:
        report(count_rows(), json_file=options.json)
        return
    if options.time_left:
        report(time_left_rows(), json_file=options.json)
        return
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, single_blas_thread():  # as verbs compute
        for case in CASES:
            if case.name in (options.cases or names):
                tell(f"{case.name}: programs")
                starts, seconds = (2, QUICK_SECONDS) if options.quick else (case.starts, SECONDS)
                rows += contest_rows(case.name, case.make(starts, options.seed, seconds, Path(folder)))
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
