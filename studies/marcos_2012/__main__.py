"""The command: ``python -m studies.marcos_2012 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from paretoik.runs.distribution import Executor
from problems.marcos_2012 import STEPS
from studies.marcos_2012.collisions import collision_rows
from studies.marcos_2012.loops import CellLoop, cells, find_starts, follow_all
from studies.marcos_2012.pictures import draw
from studies.marcos_2012.starts import start_rows
from studies.marcos_2012.tables import oracle_rows, reproduced_rows, spread_rows, table_rows, time_rows, warm_rows
from studies.processes import processes
from studies.reporting import Row, report, study_parser, tell

QUICK_STEPS = 200  # of the loop with bounded steps


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
        tell("the influence of the start, and seeds")
        rows += [*start_rows(), *spread_rows(postures, executor=executor)]
    tell("warm starts")
    rows += warm_rows(postures, seed=seed, executor=executor)
    printed = [
        (f"{one.cell.arm}, {one.cell.row}", one.run)
        for one in loops
        if one.cell.blocked and one.cell.weight in (0.0, 0.5)
    ]
    tell("steps of bounded length")
    steps = QUICK_STEPS if quick else STEPS
    rows += collision_rows(printed, postures, steps=steps, seed=seed, executor=executor)
    return loops, rows + time_rows(loops, seconds)


if __name__ == "__main__":
    main()
