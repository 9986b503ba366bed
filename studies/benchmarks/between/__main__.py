"""Limits between samples: how far optimal motions exceed them there, and the cost of the guarantee.

    python -m studies.benchmarks.between [--quick] [--cases N] [--seed N] [--json FILE]

Random problems whose limits are active are minimised from the optimum without limits: by central differences; by
splines; and then with those limits tightened that the spline's motion exceeds between samples. A motion is judged by
its positions ``at(t)`` on a grid 50 times finer. "tightening" is its cost relative to the spline's optimum before it;
"time" is that of spline and tightening relative to central differences, processor seconds without compilation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paretoik.errors import Infeasible
from paretoik.trajectory.tightening import hold_between
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.between.cases import Case, minimise_from, random_cases, worst_violation
from studies.reporting import Row, goal_row, report, study_parser, tell, timed

GOAL, COST = 1e-6, 0.2  # share of a range that differences of positions can resolve; % of the objective
CASES, QUICK_CASES = 40, 4


class Outcome(NamedTuple):
    """A motion's worst violation (infinite if its curve leaves the path), its place, the objective, and seconds."""

    violation: float = np.nan
    where: str = "none found"
    objective: float = np.nan
    seconds: float = np.nan


class Comparison(NamedTuple):
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


def compare(case: Case) -> Comparison | None:
    """Return the outcomes of a case; None if its spline has no optimum from the case's start."""
    splined, spline = _minimised(case, "spline")
    if splined is None:
        return None
    program = motion_program(case.problem("spline").task, [case.scale])
    held, _, seconds = timed(lambda: hold_between(program, splined, 1))
    tightened = _outcome(case, "spline", held.x, spline.seconds + seconds)
    return Comparison(case.name, _minimised(case, "central")[1], spline, tightened, held.violation)


def _minimised(case: Case, differences: str) -> tuple[np.ndarray | None, Outcome]:
    task = case.problem(differences).task
    q, _, seconds = timed(lambda: minimise_from(task, case.q[None]))
    return q, Outcome() if q is None else _outcome(case, differences, q, seconds)


def _outcome(case: Case, differences: str, q: np.ndarray, seconds: float) -> Outcome:
    task = case.problem(differences).task
    motion = task.motion(q)
    try:
        violation, where = worst_violation(task, motion)
    except Infeasible as error:  # its curve leaves the path
        violation, where = np.inf, str(error)
    return Outcome(violation, where, float(case.objective(motion)), seconds)


def table_rows(comparisons: Sequence[Comparison]) -> list[Row]:
    """Return the rows of all cases together, then those of each, losses first."""
    after, spline, before = (
        np.array([getattr(each, name).violation for each in comparisons]) for name in ("tightened", "spline", "central")
    )
    costs, times = np.array([each.cost for each in comparisons]), np.array([each.time for each in comparisons])
    place, between, share = ("all cases", "all"), "between samples", "share of range"
    rows = [
        goal_row(*place, "tightened, held", "cases", int(np.sum(after <= GOAL)), len(after), least=True),
        goal_row(*place, "tightened, worst", share, after.max(), GOAL),
        goal_row(*place, "tightening within its cost", "cases", int(np.sum(costs <= COST)), len(costs), least=True),
        goal_row(*place, "tightening, worst cost", "%", costs.max(), COST),
        Row(*place, "tightening, median cost", "%", float(np.median(costs))),
        Row(*place, "spline, median", share, float(np.median(spline))),
        Row(*place, "central, median", share, float(np.nanmedian(before))),
        Row(*place, "time, median", "times central", float(np.nanmedian(times))),
    ]
    for each in sorted(comparisons, key=lambda each: -each.tightened.violation):
        note = f"reports {each.reported:.1e}; {each.tightened.where}"
        rows += [
            goal_row(between, each.name, "tightened", share, each.tightened.violation, GOAL, note),
            goal_row(between, each.name, "cost", "%", each.cost, COST),
        ]
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_CASES} cases of 51 samples")
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=1, help="of the random problems")
    options = parser.parse_args(arguments)
    count, samples = (QUICK_CASES, (51,)) if options.quick else (options.cases, (51, 101))
    comparisons = list[Comparison]()
    for case in random_cases(count, options.seed, samples):
        compared = compare(case)
        tell(f"{case.name}: no optimum by splines" if compared is None else str(compared))
        comparisons += [] if compared is None else [compared]
    report(table_rows(comparisons), json_file=options.json)


if __name__ == "__main__":
    main()
