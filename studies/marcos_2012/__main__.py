"""The command: ``python -m studies.marcos_2012 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from paretoik.runs.distribution import Executor
from problems.marcos_2012 import STEPS
from studies.marcos_2012.pictures import draw
from studies.marcos_2012.starts import start_rows
from studies.marcos_2012.tables import (
    CellLoop,
    cells,
    find_starts,
    follow_all,
    oracle_rows,
    reproduced_rows,
    table_rows,
    time_rows,
    warm_rows,
)
from studies.processes import processes
from studies.reporting import Row, report, study_parser, tell


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow the paper's closed loops, report their tables and draw the figures."""
    parser = study_parser(
        "Marcos et al. 2012, CLMOGA.",
        quick="three and four links, one circle, one weight, with and without obstacles",
        out="marcos_2012",
        cluster="all closed loops that are searched",
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    with processes(options.cluster) as executor:
        loops, rows = _follow(executor, quick=options.quick, seed=options.seed)
    report(rows, json_file=options.json)
    pictures = draw(options.out, loops)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


def _follow(executor: Executor, *, quick: bool, seed: int) -> tuple[list[CellLoop], list[Row]]:
    """Return the closed loops of the tables, and all rows."""
    started = time.perf_counter()
    selection = cells(distances=[0.7], weights=[0.5]) if quick else cells()
    tell("first postures")
    postures = find_starts(selection, seed=seed, executor=executor)
    tell(f"{len(selection)} closed loops")
    loops = follow_all(selection, postures, steps=STEPS, seed=seed, executor=executor)
    seconds = time.perf_counter() - started
    rows = [*table_rows(loops), *reproduced_rows(loops), *oracle_rows(loops)]
    if not quick:
        tell("the influence of the start")
        rows += start_rows()
    tell("warm starts")
    rows += warm_rows(postures, seed=seed, executor=executor)
    return loops, rows + time_rows(loops, seconds)


if __name__ == "__main__":
    main()
