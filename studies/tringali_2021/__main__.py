"""The command: ``python -m studies.tringali_2021 [--quick] [--json FILE] [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from studies.reporting import report, study_parser
from studies.tringali_2021.pictures import draw
from studies.tringali_2021.real_time import real_time_rows
from studies.tringali_2021.trajectories import (
    MASSES,
    NUMBERS,
    lower_bound_row,
    resolve_trajectory,
    schedule_rows,
    singularity_rows,
    table_5,
    text_rows,
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Regenerate the paper's table and figures, report the rows and draw the pictures."""
    options = study_parser(
        "Tringali & Cocuzza 2021.",
        quick="8 starts of the global method, no bound, 1 round of timing, one schedule searched",
        out="tringali_2021",
    ).parse_args(arguments)
    starts, rounds, generations = (8, 1, 5) if options.quick else (48, 5, 30)
    trajectories = [resolve_trajectory(number, masses, starts=starts) for masses in MASSES for number in NUMBERS]
    rows = [row for one in trajectories for row in table_5(one)]
    rows += [] if options.quick else [lower_bound_row(4, "fitted")]
    rows += (
        [row for one in trajectories for row in text_rows(one)]
        + singularity_rows(trajectories)
        + real_time_rows(rounds=rounds)
    )
    for number in (3,) if options.quick else NUMBERS:
        rows += schedule_rows(number, "fitted", starts=starts, generations=generations)
    report(sorted(rows, key=lambda row: row.table.startswith("an update")), json_file=options.json)
    pictures = draw(options.out, trajectories)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
