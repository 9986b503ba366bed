"""Reasons why a number of ours differs from the paper's, if known: each row has its reason."""

from __future__ import annotations

AGREES = 0.01  # of a number: smaller errors are due to fitted masses and printed digits
EXPONENT = (
    "printed with e-3, read as e-4: else it would take as much as trajectory 3, a line four times as long in the same "
    "time"
)
PRINTED = "the masses of Table 1 as printed: the paper cannot have used them"
UNKNOWN = "no reason is known"
OTHERWISE = f"{UNKNOWN}: its greatest speeds agree, and no other reading of the paper that is tried below gives it"
OTHER_MINIMUM = (
    "the window at 5 s has several minima: from the posture held SLSQP ends in another, and then this agrees (other "
    "readings, below)"
)
REASONS = {
    ("trajectory 1", "joint 1 PMKE"): "half of its last printed digit is 2.9 %",
    ("trajectory 2", "PMKE"): OTHERWISE,
    ("trajectory 2", "joint 1 PMKE"): f"{UNKNOWN}; half of it with the tracking error fed back (other readings, below)",
    ("trajectory 2", "joint 1 LSV"): f"{UNKNOWN}, and no mass enters it: joint 3 and the energy agree, and no other "
    "circle gives all three (below)",
    ("trajectory 3", "PMKE"): OTHERWISE,
    ("trajectory 3", "LSV"): "at the singularity it depends on the time steps",
    ("trajectory 4", "joint 1 PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "least spectral radius PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "its time PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "global"): "the paper's is a local optimum; a bound on all motions is near ours",
}


def reason(row: str, column: str, masses: str, difference: float) -> str:
    """Return why the number of a row and column differs from the paper's by a share."""
    method, energy = column.split()[-1], " " not in column
    notes = [EXPONENT] if energy and row == "trajectory 1" else []
    if abs(difference) <= AGREES:
        notes.append("the same within 1 %")
    else:
        weighed = energy or method != "LSV" or "radius" in column  # speeds of least squares do not depend on masses
        notes += [PRINTED] if masses == "printed" and weighed else []
        explained = (row, column) in REASONS and not (method == "PMKE" and masses == "printed")
        notes += [REASONS[row, column]] if explained else []
        if not notes or notes == [EXPONENT]:
            notes.append(UNKNOWN)
    return "; ".join(notes)
