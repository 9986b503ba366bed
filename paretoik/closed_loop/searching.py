"""Searching one control step with the compiled engine: its room, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, Objectives
from paretoik.closed_loop.programs import StepPrograms
from paretoik.closed_loop.step import Instant
from paretoik.closed_loop.workspace import BOUND, Guard, Operators, Place, Room, Worth, room
from paretoik.errors import Infeasible

CROSSING = MUTATING = 0.5
SINGULAR = 1e-9  # of the largest singular value


@dataclass(frozen=True, kw_only=True, eq=False)
class Population:
    """The last population of a search: genes, their objectives, minimised, and the joint positions they lead to."""

    genes: Genes
    F: Objectives
    q: Float[np.ndarray, "points dof"]


@dataclass(kw_only=True, eq=False)
class StepSearch:
    """The compiled search of ``ControlStep``, for steps of one arm, task and set of objectives.

    With ``warm_start`` it begins with the population of the step that it searched before. It holds the room that the
    engine works in: one a thread.
    """

    programs: StepPrograms
    redundancy: int
    dof: int
    objectives: int
    population: int
    generations: int
    seed: int
    warm_start: bool = False
    room: Room = field(init=False)

    def __post_init__(self) -> None:
        """Make room."""
        inputs = max(self.programs.inputs, self.dof)
        self.room = room(self.dof, self.redundancy, self.population, self.programs.outputs, inputs)
        self._searched = False
        self._polyline = self.programs.nodes.arrays
        self._worth = Worth(self.programs.objectives.arrays, self.programs.orders)

    def __call__(self, instant: Instant) -> Population:
        """Search a step; the same seed, step and instant give the same population."""
        place, guard = self.situation(instant)
        n, given = self.dof, self.room.given
        rows = self.programs.fixed(instant.home, instant.target)
        given[4 * n : 4 * n + len(rows)] = rows[:, None]
        alive = _engine()(
            self.seed,
            instant.sample,
            self.generations,
            Operators(CROSSING, MUTATING, -BOUND, BOUND),
            place,
            self._worth,
            guard,
            self.room,
            self.warm_start and self._searched,
        )
        self._searched = True
        genes, F, order = self.room.genes, self.room.F, self.room.order
        kept = genes[order[:alive]]
        return Population(genes=kept, F=F[: self.objectives, :alive].T.copy(), q=_configured(kept, place))

    def situation(self, instant: Instant) -> tuple[Place, Guard]:
        """Return where a step begins and what it is kept from, as the engine takes it.

        Raises Infeasible where the arm is singular: no finite step makes every Δx there.
        """
        task, dt = instant.task, instant.dt
        wanted, jacobian = instant.asked()
        left, sizes, right = np.linalg.svd(jacobian)
        if not sizes[-1] > SINGULAR * sizes[0]:
            raise Infeasible(
                f"step {instant.sample} ({task.times[instant.sample]:.3g} s): a Jacobian of full rank wanted, the arm "
                f"is singular there: its condition number is {sizes[0] / max(sizes[-1], 1e-300):.3g}"
            )
        particular = right[: len(wanted)].T @ ((left.T @ wanted) / sizes)
        null = np.ascontiguousarray(right[len(wanted) :].T)
        speeds = [np.diff(instant.history, order, axis=0)[-1] / dt**order for order in (1, 2)]
        guard = Guard(
            self._polyline,
            self.programs.obstacles,
            self.programs.enclosing,
            task.min_clearance + task.link_radius,
            self.programs.reach,
            np.array(instant.lower),
            np.array(instant.upper),
            bool(np.isfinite([instant.lower, instant.upper]).any()),
            instant.swept,
            instant.standoff,
        )
        return Place(np.array(instant.previous), particular, null, np.array([*speeds, np.zeros(self.dof)]), dt), guard


def _configured(genes: np.ndarray, place: Place) -> np.ndarray:
    """Return the joint positions that genes lead to."""
    n, r = place.null.shape
    rows = genes.reshape(len(genes), r, n + 1)
    table, right = rows[..., :-1] @ place.null, rows[..., -1] - rows[..., :-1] @ place.particular
    found: np.ndarray = place.previous + place.particular
    return found + np.linalg.solve(table, right[..., None])[..., 0] @ place.null.T


@cache
def _engine() -> Any:
    from paretoik.closed_loop.engine import searched  # here: numba takes its time

    return searched
