"""The command: ``python -m studies.wan_2018 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from studies.processes import processes
from studies.reporting import report, study_parser, tell
from studies.wan_2018.fronts import comparison_rows
from studies.wan_2018.methods import resolve_table
from studies.wan_2018.pictures import draw
from studies.wan_2018.tables import euler_rows, event_rows, running_time_rows, table_rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Report the paper's tables and events and ours, and draw its figures."""
    options = study_parser(
        "Wan et al. 2018.",
        quick="from 60 random postures instead of 1000, 3 seeds instead of 31",
        out="wan_2018",
        cluster="quadratic programs from all starts and fronts of all seeds",
    ).parse_args(arguments)
    population, rounds, seeds, generations = (60, 3, 3, 5) if options.quick else (1000, 15, 31, 15)
    with processes(options.cluster) as executor:
        tables = [resolve_table(table, population=population, executor=executor) for table in ("Table 2", "Table 3")]
        fronts = comparison_rows(seeds=seeds, generations=generations, executor=executor)
    rows = [row for resolved in tables for row in table_rows(resolved)]
    tell("readings of the Euler angles")
    rows += [row for table in ("Table 2", "Table 3") for row in euler_rows(table, population=population)]
    tell("events of the figures")
    rows += event_rows(tables)
    rows += [row for resolved in tables for row in running_time_rows(resolved, rounds=rounds)]
    report([*rows, *fronts], json_file=options.json)
    print(f"{len(draw(options.out, tables))} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
