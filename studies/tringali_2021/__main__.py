"""The command: ``python -m studies.tringali_2021 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from itertools import product

from studies.processes import processes, run_each
from studies.reporting import report, study_parser, tell
from studies.tringali_2021.pictures import draw
from studies.tringali_2021.readings import READINGS, circle_row, reading_row
from studies.tringali_2021.real_time import real_time_rows
from studies.tringali_2021.splines import AHEAD, spline_rows
from studies.tringali_2021.trajectories import (
    MASSES,
    NUMBERS,
    Trajectory,
    lower_bound_row,
    resolve_trajectory,
    schedule_rows,
    table_5,
    text_rows,
)

QUICK_READINGS = READINGS[:5]


def main(arguments: Sequence[str] | None = None) -> None:
    """Regenerate the paper's table and figures, report the rows and draw the pictures."""
    options = study_parser(
        "Tringali & Cocuzza 2021.",
        quick="8 starts of the global method, no bound, 1 round of timing, one schedule searched, splines of 3 pieces, "
        f"{len(QUICK_READINGS)} of {len(READINGS)} readings",
        out="tringali_2021",
        cluster="the bound, readings, splines and schedules",
    ).parse_args(arguments)
    quick = options.quick
    starts, rounds, generations = (8, 1, 5) if quick else (48, 5, 30)
    trajectories = list[Trajectory]()
    for masses, number in product(MASSES, NUMBERS):
        tell(f"trajectory {number}, {masses} masses")
        trajectories.append(resolve_trajectory(number, masses, starts=starts))
    rows = [row for one in trajectories for row in table_5(one)]
    rows += [row for one in trajectories for row in text_rows(one)]
    tell("trajectory 2 along other circles")
    rows.append(circle_row("fitted"))
    with processes(options.cluster) as executor:
        tell("other readings" if quick else "other readings, and a bound on all motions along trajectory 4")
        single = {} if quick else {("bound", "trajectory 4"): partial(lower_bound_row, 4, "fitted")}
        for each in QUICK_READINGS if quick else READINGS:
            single["reading", each.name] = partial(reading_row, each.name, "fitted")
        rows += run_each(executor, single).values()
        tell("splines through more samples ahead")
        rows += spline_rows("fitted", ahead=AHEAD[:1] if quick else AHEAD, executor=executor)
        tell("schedules searched for")
        schedules = {
            (f"trajectory {number}",): partial(schedule_rows, number, "fitted", starts=starts, generations=generations)
            for number in ((3,) if quick else NUMBERS)
        }
        rows += [row for several in run_each(executor, schedules).values() for row in several]
    tell("updates and SLSQP's")
    rows += real_time_rows(rounds=rounds)
    if find_spec("casadi") is None:
        tell("windows by CasADi's solvers: left out, since CasADi is not installed (it comes with [bench])")
    else:
        from studies.tringali_2021.peers import window_rows

        tell("windows by CasADi's solvers")
        rows += window_rows("fitted", rounds=rounds)
    report(rows, json_file=options.json)
    pictures = draw(options.out, trajectories)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
