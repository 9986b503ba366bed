"""The paper's numbers, beside which ours are put."""

from __future__ import annotations

import csv
from functools import cache

from studies.reporting import REPORTED, Row

Place = tuple[str, str, str]


@cache
def paper() -> dict[Place, float]:
    """Return what the paper prints, by table, row and column."""
    with (REPORTED / "tringali_2020.csv").open(encoding="utf-8") as file:
        return {(row["table"], row["row"], row["column"]): float(row["paper"]) for row in csv.DictReader(file)}


def beside(table: str, masses: str, row: str, column: str, unit: str, ours: float, note: str = "") -> Row:
    """Return one number of the arm with these masses beside the paper's; the note starts with how far they differ."""
    theirs = paper().get((table, row, column))
    compared = theirs is not None and unit in ("J s", "N²m²s", "N m", "W", "rad/s")
    apart = f"{100 * (ours / theirs - 1):+.2f} %" if compared and theirs else ""
    notes = "; ".join(part for part in (apart, note) if part)
    return Row(
        table=f"{table}, {masses} masses", row=row, column=column, unit=unit, ours=ours, paper=theirs, note=notes
    )
