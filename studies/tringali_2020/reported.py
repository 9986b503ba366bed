"""The paper's numbers, and rows that compare them with ours."""

from __future__ import annotations

from functools import partial

from studies.reporting import Row, paper_numbers

Place = tuple[str, str, str]
paper = partial(paper_numbers, "tringali_2020")

AGREES = 0.01  # of a number: smaller errors are due to fitted masses, printed digits and time steps
LOW = "with the masses as printed, which the paper cannot have used"


def beside(table: str, masses: str, row: str, column: str, unit: str, ours: float, note: str = "") -> Row:
    """Return one number of the arm with these masses and the paper's; the note starts with the difference."""
    theirs, notes = paper().get((table, row, column)), [note]
    if theirs is not None and unit in ("J s", "N²m²s", "N m", "W", "rad/s", "m"):
        difference = ours / theirs - 1
        low = LOW if masses == "printed" and unit != "m" else ""
        notes = [f"{100 * difference:+.2f} %", "the same within 1 %" if abs(difference) < AGREES else low, note]
    return Row(
        table=f"{table}, {masses} masses",
        row=row,
        column=column,
        unit=unit,
        ours=ours,
        reference=theirs,
        note="; ".join(filter(None, notes)),
    )
