"""The command: ``python -m studies.wan_2018 [--quick] [--json FILE]``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from studies.reporting import report
from studies.wan_2018.fronts import comparison_rows
from studies.wan_2018.methods import speed_row, table_rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Report the paper's tables beside ours."""
    parser = argparse.ArgumentParser(prog="python -m studies.wan_2018", description="Wan et al. 2018.")
    parser.add_argument(
        "--quick", action="store_true", help="from 60 random postures instead of 1000, 3 seeds instead of 31"
    )
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    given = parser.parse_args(arguments)
    population, rounds, seeds = (60, 3, 3) if given.quick else (1000, 15, 31)
    rows = [row for table in ("Table 2", "Table 3") for row in table_rows(table, population=population)]
    rows.append(speed_row(rounds=rounds))
    rows += comparison_rows(seeds=seeds, generations=5) if given.quick else comparison_rows(seeds=seeds)
    report(rows, json_file=given.json)


if __name__ == "__main__":
    main()
