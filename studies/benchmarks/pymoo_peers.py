"""pymoo's evolutionary algorithms with their defaults, from first genes that they share with ours."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.age import AGEMOEA
from pymoo.algorithms.moo.moead import MOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
from pymoo.util.ref_dirs import get_reference_directions

from paretoik.arrays import Genes

PARTITIONS = {2: 99, 3: 12, 5: 5}  # by objectives: 100, 91 and 126 reference directions
CROWDING = {"NSGA-II": "cd", "NSGA-II, pcd": "pcd", "NSGA-II, mnn": "mnn"}
PEERS = (*CROWDING, "NSGA-III", "SMS-EMOA", "AGE-MOEA", "MOEA/D")


def pymoo_algorithm(name: str, n_obj: int, first: Genes, **operators: Any) -> Any:
    """Return one of ``PEERS``; ``operators`` are a crossover and a mutation if its own do not suit the genes.

    Those with reference directions have one per individual of a population of 100, 91 or 126 (2, 3, 5 objectives).
    """
    settings = {"sampling": first, **operators}
    if name in CROWDING:
        return NSGA2(pop_size=len(first), survival=RankAndCrowding(crowding_func=CROWDING[name]), **settings)
    if name in ("SMS-EMOA", "AGE-MOEA"):
        return {"SMS-EMOA": SMSEMOA, "AGE-MOEA": AGEMOEA}[name](pop_size=len(first), **settings)
    directions = get_reference_directions("das-dennis", n_obj, n_partitions=PARTITIONS[n_obj])
    return MOEAD(directions, **settings) if name == "MOEA/D" else NSGA3(directions, pop_size=len(first), **settings)
