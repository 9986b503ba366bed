"""Which limit an individual violates most, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float


def explain_worst(names: Sequence[str], units: Sequence[str], excess: Float[np.ndarray, "points limits"]) -> list[str]:
    """Return for each row of excesses the largest one with its unit, "" where none is above 0."""
    worst = excess.argmax(axis=1)
    return [
        f"{names[k]} violated by {row[k]:.3g} {units[k]}".rstrip() if row[k] > 0 else ""
        for row, k in zip(excess, worst, strict=True)
    ]
