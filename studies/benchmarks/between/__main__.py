"""Limits between samples: how far certified motions exceed them there, and what the guarantee costs.

    python -m studies.benchmarks.between [--quick] [--seed N] [--json FILE]

Random planar arms and the Panda, with position and pose tasks, on lines and circles, whose limits on velocity,
acceleration, torque or clearance are active. Each is planned by central differences, as before, and by splines. The
motion ``at(t)`` is judged by what both share: central differences on a grid 50 times finer than the samples, position
by position, whatever the planner computed. "tightening" is what the tightened limits cost beside the same plan without
them. Seconds are of the processor, second calls, so that nothing is compiled.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.errors import Infeasible, SolverFailed
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory import tightening
from studies.benchmarks.between.cases import Case, random_cases
from studies.benchmarks.planner.verdicts import tell
from studies.reporting import Row, report, study_parser

FINER = 50
GOAL, COST = 1e-4, 0.2  # share of a range; % of the objective
CASES, QUICK_CASES = 24, 4
STARTS = 24


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """A plan: its worst violation on the finer grid, what it says itself, and seconds."""

    violation: float
    reported: float
    seconds: float
    motion: Motion
    where: str


def finer_grid(task: MotionTask, motion: Motion, finer: int = FINER) -> Motion:
    """Return the motion ``at(t)`` on a finer grid, its rates by central differences."""
    times = np.linspace(0.0, task.times[-1], finer * (len(task.times) - 1) + 1)
    return replace(motion, time=times, q=motion.at(times), differences="central")


def outcome(case: Case, differences: str) -> Outcome:
    """Return the best plan of a case with a discretisation."""
    problem = case.problem(differences)
    planned, seconds = _timed(lambda: pk.plan(problem, starts=STARTS, seed=0))
    best = planned.best
    dense = finer_grid(problem.task, best.motion)
    return Outcome(
        violation=float(problem.task.violations(dense).max(initial=0.0)),
        reported=best.violation_between,
        seconds=seconds,
        motion=best.motion,
        where=problem.task.describe_violation(dense),
    )


def _timed(solve: Callable[[], Any]) -> tuple[Any, float]:
    solve()
    begin = time.process_time()
    return solve(), time.process_time() - begin


def tightening_cost(case: Case, spline: Outcome) -> float:
    """Return what tightened limits cost, in % of the objective without them."""
    options = tightening.OPTIONS
    tightening.OPTIONS = replace(options, rounds=0)
    try:
        without = pk.plan(case.problem("spline"), starts=STARTS, seed=0).best
    finally:
        tightening.OPTIONS = options
    return 100 * (float(case.objective(spline.motion)) / without.objective - 1)


def benchmark(cases: Iterable[Case]) -> list[Row]:
    """Return the rows of all cases, then those of all together."""
    rows, before, after, times, costs = list[Row](), list[float](), list[float](), list[float](), list[float]()
    for case in cases:
        tell(case.name)
        spline = outcome(case, "spline")
        after.append(spline.violation)
        costs.append(tightening_cost(case, spline))
        lost = "LOST; " if spline.violation > GOAL else ""
        rows += [
            _row(
                case.name,
                "spline",
                "share of range",
                spline.violation,
                GOAL,
                f"{lost}reported {spline.reported:.1e}; {spline.where}",
            ),
            _row(case.name, "tightening", "%", costs[-1], COST),
        ]
        try:
            central = outcome(case, "central")
        except (Infeasible, SolverFailed) as refusal:
            rows.append(_row(case.name, "central", "share of range", np.nan, None, str(refusal)))
            continue
        before.append(central.violation)
        times.append(spline.seconds / central.seconds)
        rows += [
            _row(case.name, "central", "share of range", central.violation, None, central.where),
            _row(case.name, "time", "times", times[-1], None, f"{spline.seconds:.3g} s beside {central.seconds:.3g} s"),
        ]
    held = sum(violation <= GOAL for violation in after)
    return [
        _row("all", "spline, held", "cases", held, len(after)),
        _row("all", "spline, worst", "share of range", max(after), GOAL),
        _row("all", "central, median", "share of range", float(np.median(before)) if before else np.nan, None),
        _row("all", "central, worst", "share of range", max(before, default=np.nan), None),
        _row("all", "tightening, worst", "%", max(costs), COST),
        _row("all", "time, median", "times", float(np.median(times)) if times else np.nan, None),
        *rows,
    ]


def _row(row: str, column: str, unit: str, value: float, goal: float | None, note: str = "") -> Row:
    return Row(
        table="between samples", row=row, column=column, unit=unit, ours=value, reference=goal, source="goal", note=note
    )


def main() -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_CASES} cases of 51 samples")
    parser.add_argument("--seed", type=int, default=1, help="of the random problems")
    arguments = parser.parse_args()
    count, samples = (QUICK_CASES, (51,)) if arguments.quick else (CASES, (51, 101))
    report(benchmark(random_cases(count, arguments.seed, samples)), json_file=arguments.json)


if __name__ == "__main__":
    main()
