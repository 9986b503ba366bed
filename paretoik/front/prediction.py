"""Where a move along a front is expected to lead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from paretoik.arrays import Values
from paretoik.tables import fit_screen, html_representation


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """The objectives (n_obj,) that a move is expected to lead to, in the user's own sign, and the motion that has them.

    It is no point of the front: it has no id and no certificate. ``motion`` is None where the front has none.
    """

    objectives: Values
    names: Sequence[str]
    units: Sequence[str]
    motion: Any = None

    def __repr__(self) -> str:
        values = (
            f"{name} {value:.4g} {unit}".rstrip()
            for name, value, unit in zip(self.names, self.objectives, self.units, strict=True)
        )
        return fit_screen(f"Prediction, not certified: {', '.join(values)}")

    _repr_html_ = html_representation
