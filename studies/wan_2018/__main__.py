"""The command: ``python -m studies.wan_2018 [--quick] [--json FILE]``."""

from __future__ import annotations

from collections.abc import Sequence

from studies.reporting import report, study_parser
from studies.wan_2018.fronts import comparison_rows
from studies.wan_2018.methods import speed_row, table_rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Report the paper's tables beside ours."""
    options = study_parser(
        "Wan et al. 2018.", quick="from 60 random postures instead of 1000, 3 seeds instead of 31"
    ).parse_args(arguments)
    population, rounds, seeds = (60, 3, 3) if options.quick else (1000, 15, 31)
    rows = [row for table in ("Table 2", "Table 3") for row in table_rows(table, population=population)]
    rows.append(speed_row(rounds=rounds))
    rows += comparison_rows(seeds=seeds, generations=5) if options.quick else comparison_rows(seeds=seeds)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
