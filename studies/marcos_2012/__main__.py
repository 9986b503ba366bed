"""The command: ``python -m studies.marcos_2012 [--quick] [--json FILE] [--out FOLDER]``."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from problems.marcos_2012 import STEPS
from studies.marcos_2012.collisions import collision_rows
from studies.marcos_2012.loops import cells, followed, starts
from studies.marcos_2012.pictures import draw
from studies.marcos_2012.starts import start_rows
from studies.marcos_2012.tables import oracle_rows, reproduced_rows, spread_rows, table_rows, time_rows, warm_rows
from studies.reporting import report

QUICK_STEPS = 200


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow the paper's closed loops, report their tables and draw the figures."""
    parser = argparse.ArgumentParser(prog="python -m studies.marcos_2012", description="Marcos et al. 2012, CLMOGA.")
    parser.add_argument("--quick", action="store_true", help="three links, one circle, two weights, 200 steps")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    parser.add_argument("--out", type=Path, default=Path("runs/marcos_2012"), help="folder for the pictures")
    given = parser.parse_args(arguments)
    begun = time.perf_counter()
    steps = QUICK_STEPS if given.quick else STEPS
    wanted = cells(links=[3], distances=[0.7], weights=[0.5, 1.0]) if given.quick else cells()
    begins = starts(wanted, seed=given.seed)
    found = list(followed(wanted, begins, steps=steps, seed=given.seed))
    seconds = time.perf_counter() - begun
    rows = [] if given.quick else [*table_rows(found), *reproduced_rows(found)]
    rows += oracle_rows(found)
    rows += [] if given.quick else [*start_rows(), *spread_rows(begins)]
    rows += warm_rows(begins, seed=given.seed)
    printed = [
        (f"{one.cell.arm}, {one.cell.row}", one.run)
        for one in found
        if one.cell.blocked and one.cell.weight in (0.0, 0.5)
    ]
    rows += collision_rows(printed, begins, steps=steps, seed=given.seed)
    rows += time_rows(found, seconds)
    report(rows, json_file=given.json)
    pictures = draw(given.out, found)
    print(f"{len(pictures)} pictures in {given.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
