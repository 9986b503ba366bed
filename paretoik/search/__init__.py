"""How fronts are found: MaxiMin selection, evolution, archive, ask and tell."""

from __future__ import annotations

from paretoik.search.archive import Archive, Failures, Members
from paretoik.search.ask_tell import Candidates, Search
from paretoik.search.constraints import violations
from paretoik.search.endings import (
    Ending,
    Evaluations,
    Generations,
    Stagnation,
    Target,
    TimeLimit,
)
from paretoik.search.evolution import evolve
from paretoik.search.mating import BranchwiseMating
from paretoik.search.maximin import MaxiMin, survivors
from paretoik.search.nsga2 import MaxiMinNSGA2
from paretoik.search.progress import Progress
from paretoik.search.seeding import seeded_population

__all__ = [
    "Archive",
    "BranchwiseMating",
    "Candidates",
    "Ending",
    "Evaluations",
    "Failures",
    "Generations",
    "MaxiMin",
    "MaxiMinNSGA2",
    "Members",
    "Progress",
    "Search",
    "Stagnation",
    "Target",
    "TimeLimit",
    "evolve",
    "seeded_population",
    "survivors",
    "violations",
]
