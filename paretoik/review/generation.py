"""What is recorded of one generation of a search."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.arrays import Ids, Objectives


@dataclass(frozen=True, kw_only=True, eq=False)
class Generation:
    """One generation: objectives (points, n_obj) in the user's own sign, the front's ids, what is known of both.

    ``hypervolume`` is in the product of the objectives' units, ``failed`` counts evaluations that gave no number.
    """

    number: int
    population: Objectives
    front: Objectives
    front_ids: Ids
    hypervolume: float
    failed: int = 0
