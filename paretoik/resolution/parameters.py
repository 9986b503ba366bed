"""Numbers of methods: their values, their ranges, and the scales on which they are searched."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_text, finite_array, read_list

Number: TypeAlias = float | np.ndarray
Scale = Literal["linear", "log", "integer"]


@dataclass(frozen=True)
class Parameter:
    """A number that is searched between bounds.

    name: name of the number
    lower, upper: bounds
    scale: "linear", "log" to search its decimal logarithm, or "integer" for whole numbers
    fields: fields of the method that the number sets, by default the field of the same name

    Raises InvalidInput for invalid bounds.
    """

    name: str
    lower: float
    upper: float
    _: KW_ONLY
    scale: Scale = "linear"
    fields: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_text("parameter: name", self.name)
        label = f"parameter {self.name}"
        check_choice(f"{label}: scale", self.scale, get_args(Scale))
        fields = read_list(f"{label}: fields", self.fields, str, "names of fields")
        lower, upper = (finite_array(f"{label}, {side}", getattr(self, side), ()) for side in ("lower", "upper"))
        if not lower <= upper:
            raise InvalidInput(f"{label}: lower bound must be at most the upper one, got {lower:g} to {upper:g}")
        if self.scale == "log" and not lower > 0:
            raise InvalidInput(f"{label}: lower bound must be above 0 on a log scale, got {lower:g}")
        if self.scale == "integer" and (lower % 1 or upper % 1):
            raise InvalidInput(f"{label}: bounds must be whole on an integer scale, got {lower:g} to {upper:g}")
        object.__setattr__(self, "fields", fields or (self.name,))

    @property
    def gene_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the gene."""
        if self.scale == "log":
            return float(np.log10(self.lower)), float(np.log10(self.upper))
        margin = 1 - 1e-9 if self.scale == "integer" else 0.0  # so that the upper bound can be reached by rounding down
        return float(self.lower), float(self.upper) + margin

    def decode(self, genes: Float[np.ndarray, " points"]) -> Shaped[np.ndarray, " points"]:
        """Return the values of genes."""
        if self.scale == "log":
            return np.asarray(10.0**genes)
        return np.floor(genes).astype(int) if self.scale == "integer" else genes


def number(
    *, below: float = np.inf, search: tuple[float, float] | None = None, scale: Scale = "linear"
) -> dict[str, Any]:
    """Return the metadata of a field from 0 to less than ``below``, searched in ``search`` by default."""
    return {"below": below, "search": search, "scale": scale}
