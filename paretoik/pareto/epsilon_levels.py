"""Levels of ε, each minimised when its turn comes, or by workers ahead of that.

A sweep is sequential: where a level goes depends on those before. It often can be foretold, and as what a level leads
to follows from the level alone, workers may be there first: the sweep comes to the same, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Point
from paretoik.distribution import workers
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.pareto.epsilon_options import OPTIONS
from paretoik.pareto.scalarisation import Observe, main_weights, minimise_weighted

Key: TypeAlias = tuple[bytes, int, bytes, InteriorPointOptions]


class Level(NamedTuple):
    """The objective ``main`` is minimised from a point ``x``, the others below ``upper`` and with little weight."""

    x: Point
    main: int
    upper: Float[np.ndarray, " n_obj"]
    barrier: InteriorPointOptions = OPTIONS.warm

    @property
    def key(self) -> Key:
        """What tells it from others."""
        return self.x.tobytes(), self.main, self.upper.tobytes(), self.barrier


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelSolver:
    """Minimises levels of a ``program``; ``ahead`` has what workers have minimised before its turn."""

    program: Program
    n_obj: int
    solver: Solver
    ahead: dict[Key, Solutions] = field(default_factory=dict)

    def solve(self, levels: Sequence[Level], observe: Observe | None = None) -> Solutions:
        """Return where levels lead, workers having been there or not; ``observe`` looks on."""
        missing = [level for level in levels if level.key not in self.ahead]
        solutions = self.ahead | (self._minimise(missing, observe) if missing else {})
        if observe is not None and not missing:
            observe(len(levels), len(levels))
        return concatenate([solutions[level.key] for level in levels])

    def look_ahead(self, levels: Sequence[Level]) -> None:
        """Let workers, if there are any, minimise levels that are likely to come, once the first of them is due."""
        missing = {level.key: level for level in levels if level.key not in self.ahead}
        if workers() > 1 and len(missing) > 1 and levels[0].key in missing:
            self.ahead.update(self._minimise(list(missing.values()), None))

    def _minimise(self, levels: Sequence[Level], observe: Observe | None) -> dict[Key, Solutions]:
        solutions = minimise_weighted(
            self.program,
            np.stack([level.x for level in levels]),
            main_weights(self.n_obj, np.array([level.main for level in levels]), OPTIONS.weight),
            np.stack([level.upper for level in levels]),
            [level.barrier for level in levels],
            solver=self.solver,
            batch=OPTIONS.batch,
            observe=observe,
        )
        return {level.key: solutions[i : i + 1] for i, level in enumerate(levels)}
