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
from studies.reporting import report, study_parser, tell

QUICK_STEPS = 200  # of the loop with bounded steps


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow the paper's closed loops, report their tables and draw the figures."""
    parser = study_parser(
        "Marcos et al. 2012, CLMOGA.",
        quick="three links, one circle, one weight, with and without obstacles",
        out="marcos_2012",
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    selection = cells(links=[3], distances=[0.7], weights=[0.5]) if options.quick else cells()
    tell("first postures")
    postures = find_starts(selection, seed=options.seed)
    tell(f"{len(selection)} closed loops")
    loops = list(follow_all(selection, postures, steps=STEPS, seed=options.seed))
    seconds = time.perf_counter() - started
    rows = [*table_rows(loops), *reproduced_rows(loops)]
    rows += oracle_rows(loops)
    if not options.quick:
        tell("what the start decides, and seeds")
        rows += [*start_rows(), *spread_rows(postures)]
    tell("warm starts")
    rows += warm_rows(postures, seed=options.seed)
    printed = [
        (f"{one.cell.arm}, {one.cell.row}", one.run)
        for one in loops
        if one.cell.blocked and one.cell.weight in (0.0, 0.5)
    ]
    tell("steps of bounded length")
    rows += collision_rows(printed, postures, steps=QUICK_STEPS if options.quick else STEPS, seed=options.seed)
    rows += time_rows(loops, seconds)
    report(rows, json_file=options.json)
    pictures = draw(options.out, loops)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
