"""What a user sets of a run, as one record that the ways of solving share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from paretoik.execution.executor import check_workers
from paretoik.inputs import check_flag, check_size, positive_number
from paretoik.nlp.program import Solver, check_solver_name


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveSettings:
    """The keywords of ``solve`` that say what is computed; None leaves a size to the problem or to the defaults."""

    population: int | None = None
    generations: int | None = None
    seed: int | None = None
    islands: int = 1
    initial: Any = None
    time_limit: float | None = None
    evaluations: int | None = None
    target: Sequence[float] | None = None
    stagnation: bool = True
    anchors: int | None = None
    algorithm: Any = None
    points: int | None = 200
    refine: bool = False
    solver: Solver = "auto"
    record_steps: Sequence[int] = ()
    workers: int | None = None
    cluster: str | None = None
    evaluation_timeout: float | None = None

    def __post_init__(self) -> None:
        """Check what means the same for every way of solving."""
        check_size("islands", self.islands, 1)
        check_flag("stagnation", self.stagnation)
        check_flag("refine", self.refine)
        check_solver_name(self.solver)
        check_workers(self.workers, self.cluster)
        if self.evaluation_timeout is not None:
            positive_number("evaluation_timeout", self.evaluation_timeout, "s")


@dataclass(frozen=True, kw_only=True)
class SearchDefaults:
    """Sizes of a search where a user gives none: individuals, generations at most, and the seed.

    Where the front is refined, too, the search has a share of the time limit, ``search_time``.
    """

    population: int = 200
    generations: int = 500
    seed: int = 0
    search_time: float = 0.5


DEFAULTS = SearchDefaults()
