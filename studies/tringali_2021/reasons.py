"""Why a number of ours is not the paper's, as far as that is known: it stands beside each row."""

from __future__ import annotations

AGREES = 0.01  # of a number: less is what fitted masses and printed digits leave
EXPONENT = (
    "printed with e-3, read as e-4: else it would take as much as trajectory 3, a line four times as long in the same "
    "time"
)
PRINTED = "the masses of Table 1 as printed: the paper cannot have used them"
UNKNOWN = "no reason is known"
REASONS = {
    ("trajectory 2", "PMKE"): f"{UNKNOWN}: on the same circle least squares agree, the other way round is no nearer",
    ("trajectory 2", "joint 1 LSV"): f"{UNKNOWN}, and no mass enters it: joint 3 and the energy agree",
    ("trajectory 3", "PMKE"): f"{UNKNOWN}: its greatest speeds and the global optimum agree",
    ("trajectory 3", "LSV"): "at the singularity it hangs on the time steps",
    ("trajectory 4", "global"): "the paper's is a local optimum; a bound on all motions is near ours",
}


def reason(row: str, column: str, masses: str, difference: float) -> str:
    """Return why the number of a row and column is off by such a share of the paper's."""
    method, energy = column.split()[-1], " " not in column
    notes = [EXPONENT] if energy and row == "trajectory 1" else []
    if abs(difference) <= AGREES:
        notes.append("the same within 1 %")
    else:
        weighed = energy or method != "LSV" or "radius" in column  # speeds of least squares know no masses
        notes += [PRINTED] if masses == "printed" and weighed else []
        notes += [REASONS[row, column]] if (row, column) in REASONS else []
        if not notes or notes == [EXPONENT]:
            notes.append(f"{UNKNOWN}: looking ahead agrees to a few per cent only" if method == "PMKE" else UNKNOWN)
    return "; ".join(notes)
