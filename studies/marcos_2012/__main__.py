"""The command: ``python -m studies.marcos_2012 [--quick] [--json FILE] [--out FOLDER]``."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from problems.marcos_2012 import STEPS
from studies.marcos_2012.collisions import collision_rows
from studies.marcos_2012.loops import cells, find_starts, follow_all
from studies.marcos_2012.pictures import draw
from studies.marcos_2012.starts import start_rows
from studies.marcos_2012.tables import oracle_rows, reproduced_rows, spread_rows, table_rows, time_rows, warm_rows
from studies.reporting import report, study_parser

QUICK_STEPS = 200


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow the paper's closed loops, report their tables and draw the figures."""
    parser = study_parser(
        "Marcos et al. 2012, CLMOGA.", quick="three links, one circle, two weights, 200 steps", out="marcos_2012"
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    steps = QUICK_STEPS if options.quick else STEPS
    selection = cells(links=[3], distances=[0.7], weights=[0.5, 1.0]) if options.quick else cells()
    postures = find_starts(selection, seed=options.seed)
    loops = list(follow_all(selection, postures, steps=steps, seed=options.seed))
    seconds = time.perf_counter() - started
    rows = [] if options.quick else [*table_rows(loops), *reproduced_rows(loops)]
    rows += oracle_rows(loops)
    rows += [] if options.quick else [*start_rows(), *spread_rows(postures)]
    rows += warm_rows(postures, seed=options.seed)
    printed = [
        (f"{one.cell.arm}, {one.cell.row}", one.run)
        for one in loops
        if one.cell.blocked and one.cell.weight in (0.0, 0.5)
    ]
    rows += collision_rows(printed, postures, steps=steps, seed=options.seed)
    rows += time_rows(loops, seconds)
    report(rows, json_file=options.json)
    pictures = draw(options.out, loops)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
