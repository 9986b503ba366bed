"""What is recorded of one generation of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives

Population: TypeAlias = Float[np.ndarray, "individuals n_obj"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Generation:
    """One generation: the objectives of its population and front in the user's own sign, the front's ids.

    ``hypervolume`` is in the product of the objectives' units, ``failed`` counts evaluations that gave no number.
    """

    number: int
    population: Population
    front: Objectives
    front_ids: Ids
    hypervolume: float
    failed: int = 0
