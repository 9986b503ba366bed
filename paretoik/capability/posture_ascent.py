"""Local maxima over all postures of an arm of any kind: many starts, and ascent over posture, sliders and speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.capability.actuation import Actuation
from paretoik.capability.directional_program import DirectionalProgram
from paretoik.capability.joint_capability import Quantity, values_at
from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.nlp.dense import DenseProgram
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.robot.arm import Arm
from paretoik.self_motion.start_postures import wrap_difference


@dataclass(frozen=True, kw_only=True)
class AscentOptions:
    """Settings of the ascent from many starts."""

    largest: int = 24  # starts of a direction, at most
    smallest: int = 6  # at least
    repeats: int = 3  # starts that have to end at the best value before the search of a direction ends
    value_tolerance: float = 1e-6  # share by which two values may differ and be the same
    rounds: int = 4  # of trying what was best for one direction in the others
    batch: int = 2000  # postures whose values are computed together, for the memory it takes
    distance: float = 0.5  # of starts in some joint, at least [rad, m]
    feasible: float = 1e-8  # violation of the program up to which an end is feasible
    interior_point: InteriorPointOptions = InteriorPointOptions(barrier=1e-2, iterations=300)  # from a start
    # near a maximum, or where interior points do not converge
    sqp: InteriorPointOptions = InteriorPointOptions(radius=0.1, iterations=200, tolerance=1e-9)


OPTIONS = AscentOptions()


def maximise_from(
    arm: Arm,
    actuation: Actuation,
    position: Float[np.ndarray, " task"],
    directions: Float[np.ndarray, "directions task"],
    quantity: Quantity,
    starts: Float[np.ndarray, "starts dof"],
) -> Float[np.ndarray, "directions dof"]:
    """Return the best posture of each direction that ascent from postures leads to, for an arm of any kind.

    What is best for one direction is tried for all others, and those that it improves ascend from there again.
    """
    search = MultistartAscent(arm, actuation, position, directions, quantity, starts)
    waiting = list(range(len(directions)))
    for turn in range(OPTIONS.rounds):
        for k in waiting:
            search.ascend_from_best(k) if turn == 0 else search.ascend(k, search.q[search.best[k]], near=True)
        waiting = search.improved_elsewhere()
    return search.q[search.best]


class MultistartAscent:
    """Postures that can be held, those of the ends added, and their ``values`` (postures, directions)."""

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        position: np.ndarray,
        directions: np.ndarray,
        quantity: Quantity,
        starts: np.ndarray,
    ) -> None:
        self.arm, self.actuation, self.position = arm, actuation, position
        self.directions, self.quantity = directions, quantity
        self.program = DirectionalProgram(arm=arm, actuation=actuation, quantities=(quantity,))
        parts = np.array_split(starts, -(-len(starts) // OPTIONS.batch))
        self.q = starts
        self.values = np.concatenate([values_at(arm, actuation, directions, quantity, part) for part in parts])
        self.ascended = np.zeros(len(directions))

    @property
    def best(self) -> Int[np.ndarray, " directions"]:
        """Which posture is the best of all along each direction."""
        index: np.ndarray = self.values.argmax(axis=0)
        return index

    def ascend_from_best(self, k: int) -> None:
        """Ascend along a direction from its best postures until the best end was met often, or enough were tried."""
        ends = list[float]()
        for start in distant_postures(self.arm, self.q[np.argsort(-self.values[:, k], kind="stable")]):
            ends.append(self.ascend(k, start))
            best = np.sum(np.array(ends) >= max(ends) * (1 - OPTIONS.value_tolerance))
            if len(ends) >= OPTIONS.smallest and best >= OPTIONS.repeats:
                break

    def ascend(self, k: int, start: np.ndarray, *, near: bool = False) -> float:
        """Ascend along a direction from a posture, keep where that ends, and return its value, 0 without an end."""
        size = float(self.values[:, k].max())
        if not 0 < size < np.inf:
            return 0.0
        q = ascend(self.program, self.position, self.directions[k], size, start, near=near)
        if q is None:
            return 0.0
        values = values_at(self.arm, self.actuation, self.directions, self.quantity, q[None])
        if np.isnan(values).any():
            return 0.0
        self.q, self.values = np.concatenate([self.q, q[None]]), np.concatenate([self.values, values])
        self.ascended[k] = max(self.ascended[k], float(values[0, k]))
        return float(values[0, k])

    def improved_elsewhere(self) -> list[int]:
        """Return the directions along which a posture that another direction led to is the best."""
        limit = self.ascended * (1 + OPTIONS.value_tolerance)
        improved: list[int] = np.flatnonzero(self.values.max(axis=0) > limit).tolist()
        return improved


def ascend(
    program: DirectionalProgram,
    position: Float[np.ndarray, " task"],
    direction: Float[np.ndarray, " task"],
    size: float,
    start: Float[np.ndarray, " dof"],
    *,
    near: bool = False,
) -> Float[np.ndarray, " dof"] | None:
    """Return the posture, a local maximum along a direction, that a start leads to; None where its limits don't hold.

    ``size`` [m/s, N] is about how much there is. ``near`` a maximum quadratic programs stay with it, which interior
    points may leave.
    """
    cost = np.zeros((1, program.unknowns))
    cost[0, program.slices["values"]] = -1.0
    dense = DenseProgram(rows=program.program(position, direction[None], np.array([size])), costs=cost)
    first, weight = program.initial_point(start)[None], np.ones((1, 1))
    try:
        end = None if near else minimise(dense, first, weight, options=OPTIONS.interior_point)
        if end is None or not end.converged[0]:
            restart = first if end is None or end.violation[0] > OPTIONS.feasible else end.x
            end = minimise(dense, restart, weight, options=OPTIONS.sqp, solver="sqp")
    except (EvaluationFailed, SolverFailed):  # rods that do not reach
        return None
    return program.parts(end.x[0], np.array([size]))["q"] if end.violation[0] <= OPTIONS.feasible else None


def distant_postures(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """Return the first few postures that are not near each other."""
    chosen, remaining = list[np.ndarray](), q
    while len(remaining) and len(chosen) < OPTIONS.largest:
        chosen.append(remaining[0])
        distances = np.abs(wrap_difference(remaining - remaining[0], arm.periodic)).max(axis=1)
        remaining = remaining[distances > OPTIONS.distance]
    return chosen
