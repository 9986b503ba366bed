"""The paper's numbers, beside which ours are put."""

from __future__ import annotations

from functools import partial

from studies.reporting import Row, paper_numbers

Place = tuple[str, str, str]
paper = partial(paper_numbers, "tringali_2020")


def beside(table: str, masses: str, row: str, column: str, unit: str, ours: float, note: str = "") -> Row:
    """Return one number of the arm with these masses beside the paper's; the note starts with how far they differ."""
    theirs = paper().get((table, row, column))
    comparable = theirs is not None and unit in ("J s", "N²m²s", "N m", "W", "rad/s")
    difference = f"{100 * (ours / theirs - 1):+.2f} %" if comparable and theirs else ""
    notes = "; ".join(part for part in (difference, note) if part)
    return Row(
        table=f"{table}, {masses} masses", row=row, column=column, unit=unit, ours=ours, reference=theirs, note=notes
    )
