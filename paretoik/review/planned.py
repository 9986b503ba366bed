"""What is drawn of a plan's levels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLevel:
    """A level of ``samples`` that is done, the ``number``-th from 0: the objective of its starts, and of its optima.

    Values are in the objective's own sign, of the optima best first.
    """

    number: int
    samples: int
    starts: Float[np.ndarray, " starts"]
    optima: Float[np.ndarray, " optima"]
