"""Names and units of objectives: what fits a table."""

from __future__ import annotations

from collections.abc import Sequence

from paretoik.errors import InvalidInput
from paretoik.inputs import shown

RESERVED_NAMES = ("id", "violation", "violation_between", "criticality", "kkt_residual", "status")


def check_names(names: Sequence[str], units: Sequence[str]) -> None:
    """Raise InvalidInput for names or units that do not fit a table, or names that repeat."""
    if len(set(names)) != len(names):
        raise InvalidInput(f"front names: wanted each objective named once, got {list(names)}")
    for name in names:
        printable = isinstance(name, str) and name.isprintable() and name.strip() == name
        if not printable or name[:1] in ("", "=", "+", "-", "@"):  # these make a spreadsheet run the cell
            raise InvalidInput(
                f"front names: wanted printable, without outer spaces or a leading = + - @, got {shown(name)}"
            )
        if name in RESERVED_NAMES:
            raise InvalidInput(f"front names: wanted none of {', '.join(RESERVED_NAMES)}, got {shown(name)}")
    for unit in units:
        if not isinstance(unit, str) or not unit.isprintable():
            raise InvalidInput(f"front units: wanted printable text, got {shown(unit)}")
