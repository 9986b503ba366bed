"""The command: ``python -m studies.marcos_2012 [--quick] [--json FILE] [--out FOLDER]``."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from problems.marcos_2012 import STEPS
from studies.marcos_2012.collisions import collision_rows
from studies.marcos_2012.loops import cells, followed, starts
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
    begun = time.perf_counter()
    steps = QUICK_STEPS if options.quick else STEPS
    wanted = cells(links=[3], distances=[0.7], weights=[0.5, 1.0]) if options.quick else cells()
    begins = starts(wanted, seed=options.seed)
    found = list(followed(wanted, begins, steps=steps, seed=options.seed))
    seconds = time.perf_counter() - begun
    rows = [] if options.quick else [*table_rows(found), *reproduced_rows(found)]
    rows += oracle_rows(found)
    rows += [] if options.quick else [*start_rows(), *spread_rows(begins)]
    rows += warm_rows(begins, seed=options.seed)
    printed = [
        (f"{one.cell.arm}, {one.cell.row}", one.run)
        for one in found
        if one.cell.blocked and one.cell.weight in (0.0, 0.5)
    ]
    rows += collision_rows(printed, begins, steps=steps, seed=options.seed)
    rows += time_rows(found, seconds)
    report(rows, json_file=options.json)
    pictures = draw(options.out, found)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
