"""Numbers of a method that can be searched: between which bounds, and on which scale."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array

Number: TypeAlias = float | np.ndarray
Scale = Literal["linear", "log", "integer"]


@dataclass(frozen=True)
class Parameter:
    """A number that is searched between ``lower`` and ``upper``.

    ``scale`` "log" searches its decimal logarithm, "integer" whole numbers. It sets the ``fields`` of the method, by
    default the one of its own name: one number may set several. Raises InvalidInput for bounds that are no range.
    """

    name: str
    lower: float
    upper: float
    _: KW_ONLY
    scale: Scale = "linear"
    fields: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the range."""
        what = f"parameter {self.name}"
        if self.scale not in get_args(Scale):
            raise InvalidInput(f"{what}: scale must be one of {', '.join(get_args(Scale))}, got {self.scale!r}")
        lower, upper = (finite_array(f"{what}, {side}", getattr(self, side), ()) for side in ("lower", "upper"))
        if not lower <= upper:
            raise InvalidInput(f"{what}: a lower bound up to the upper one wanted, got {lower:g} to {upper:g}")
        if self.scale == "log" and not lower > 0:
            raise InvalidInput(f"{what}: a lower bound above 0 wanted on a log scale, got {lower:g}")
        if self.scale == "integer" and (lower % 1 or upper % 1):
            raise InvalidInput(f"{what}: whole bounds wanted on an integer scale, got {lower:g} to {upper:g}")
        object.__setattr__(self, "fields", tuple(self.fields) or (self.name,))

    @property
    def gene_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the gene."""
        if self.scale == "log":
            return float(np.log10(self.lower)), float(np.log10(self.upper))
        margin = 1 - 1e-9 if self.scale == "integer" else 0.0  # the floor of the upper bound is within the range
        return float(self.lower), float(self.upper) + margin

    def decode(self, genes: Float[np.ndarray, " points"]) -> Shaped[np.ndarray, " points"]:
        """Return the values that genes stand for."""
        if self.scale == "log":
            return np.asarray(10.0**genes)
        return np.floor(genes).astype(int) if self.scale == "integer" else genes
