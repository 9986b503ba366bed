"""Limits between samples: how far optimal motions exceed them there, and the cost of the guarantee.

    python -m studies.benchmarks.between [--quick] [--cases N] [--seed N] [--json FILE]

Random planar arms and the Panda, with position and pose tasks, on lines and circles, whose limits on velocity,
acceleration, torque or clearance are active. Each is minimised from the optimum without limits: by central differences,
as before; by splines; and then with those limits tightened that the spline's motion exceeds between samples. A motion
is judged by its positions ``at(t)`` on a grid 50 times finer than the samples (``judging``). "tightening" is its cost
relative to the spline's optimum before it, which may be better than any motion within its limits. "time" is that of
spline and tightening relative to central differences, processor seconds without compilation. A line is printed after
every case; the tables come at the end, losses first.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.errors import Infeasible
from paretoik.trajectory.tightening import hold_between
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.between.cases import Case, minimise_from, random_cases
from studies.benchmarks.between.judging import worst_violation
from studies.reporting import Row, report, study_parser, tell

GOAL, COST = 1e-6, 0.2  # share of a range that differences of positions can resolve; % of the objective
CASES, QUICK_CASES = 40, 4


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A motion's worst violation, its place in words, the objective, and seconds; NaN without a motion.

    The violation of a motion whose curve leaves its path between samples is infinite.
    """

    violation: float = np.nan
    where: str = "none found"
    objective: float = np.nan
    seconds: float = np.nan


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The outcomes of a case: central differences, splines, and splines whose limits are tightened."""

    name: str
    central: Outcome
    spline: Outcome
    tightened: Outcome
    reported: float

    @property
    def cost(self) -> float:
        """The cost of tightening [%]."""
        return 100 * (self.tightened.objective / self.spline.objective - 1)

    @property
    def time(self) -> float:
        """Time of splines and tightening relative to central differences."""
        return self.tightened.seconds / self.central.seconds

    @property
    def summary(self) -> str:
        """Everything in one line."""
        return (
            f"{self.name}: central {self.central.violation:.1e}, spline {self.spline.violation:.1e}, tightened "
            f"{self.tightened.violation:.1e} (reports {self.reported:.1e}), cost {self.cost:.3f} %, "
            f"time {self.time:.1f} times"
        )


def compare(case: Case) -> Comparison | None:
    """Return the outcomes of a case; None if its spline has no optimum from the case's start."""
    splined, spline = _minimised(case, "spline")
    if splined is None:
        return None
    task = case.problem("spline").task
    program = motion_program(task, [case.scale])
    held, seconds = _timed(lambda: hold_between(program, splined, 1))
    tightened = _outcome(case, "spline", held.x, spline.seconds + seconds)
    _, central = _minimised(case, "central")
    return Comparison(name=case.name, central=central, spline=spline, tightened=tightened, reported=held.violation)


def _minimised(case: Case, differences: str) -> tuple[np.ndarray | None, Outcome]:
    task = case.problem(differences).task
    q, seconds = _timed(lambda: minimise_from(task, case.q[None]))
    return q, Outcome() if q is None else _outcome(case, differences, q, seconds)


def _outcome(case: Case, differences: str, q: np.ndarray, seconds: float) -> Outcome:
    task = case.problem(differences).task
    motion = task.motion(q)
    try:
        violation, where = worst_violation(task, motion)
    except Infeasible as error:  # its curve leaves the path
        violation, where = np.inf, str(error)
    return Outcome(violation=violation, where=where, objective=float(case.objective(motion)), seconds=seconds)


def _timed(solve: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.process_time()
    return solve(), time.process_time() - begin


def table_rows(comparisons: Sequence[Comparison]) -> list[Row]:
    """Return the rows of all cases together, then those of each, losses first."""
    after = np.array([each.tightened.violation for each in comparisons])
    before = np.array([each.central.violation for each in comparisons])
    costs, times = np.array([each.cost for each in comparisons]), np.array([each.time for each in comparisons])
    spline = np.array([each.spline.violation for each in comparisons])
    rows = [
        _row("all", "tightened, held", "cases", int(np.sum(after <= GOAL)), len(after)),
        _row("all", "tightened, worst", "share of range", after.max(), GOAL),
        _row("all", "tightening within its cost", "cases", int(np.sum(costs <= COST)), len(costs)),
        _row("all", "tightening, worst cost", "%", costs.max(), COST),
        _row("all", "tightening, median cost", "%", np.median(costs), None),
        _row("all", "spline, median", "share of range", np.median(spline), None),
        _row("all", "spline, worst", "share of range", spline.max(), None),
        _row("all", "central, median", "share of range", np.nanmedian(before), None),
        _row("all", "central, worst", "share of range", np.nanmax(before), None),
        _row("all", "time, median", "times central", np.nanmedian(times), None),
    ]
    for each in sorted(comparisons, key=lambda each: -each.tightened.violation):
        prefix = "LOST; " if each.tightened.violation > GOAL else ""
        note = f"{prefix}reports {each.reported:.1e}; {each.tightened.where}"
        rows += [
            _row(each.name, "tightened", "share of range", each.tightened.violation, GOAL, note),
            _row(each.name, "spline", "share of range", each.spline.violation, None, each.spline.where),
            _row(each.name, "central", "share of range", each.central.violation, None, each.central.where),
            _row(each.name, "cost", "%", each.cost, COST, "LOST" if each.cost > COST else ""),
            _row(each.name, "time", "times central", each.time, None),
        ]
    return rows


def _row(row: str, column: str, unit: str, value: float, goal: float | None, note: str = "") -> Row:
    table = "all cases" if row == "all" else "between samples"
    return Row(table, row, column, unit, float(value), reference=goal, source="goal", note=note)


def compare_all(cases: Iterable[Case]) -> list[Comparison]:
    """Return the comparisons of cases, and print each when it is done."""
    comparisons = list[Comparison]()
    for case in cases:
        compared = compare(case)
        tell(f"{case.name}: no optimum by splines" if compared is None else compared.summary)
        comparisons += [] if compared is None else [compared]
    return comparisons


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_CASES} cases of 51 samples")
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=1, help="of the random problems")
    options = parser.parse_args(arguments)
    count, samples = (QUICK_CASES, (51,)) if options.quick else (options.cases, (51, 101))
    report(table_rows(compare_all(random_cases(count, options.seed, samples))), json_file=options.json)


if __name__ == "__main__":
    main()
