"""Plans of time-optimal control: the fastest path to the target in a few pieces, by second-order cone programs.

The unknowns of a plan are the points between its pieces and the intervals that they take. The velocity limit
‖R v‖ ≤ 1 is linearised around the last path, again and again, which leaves second-order cone programs; a step is taken
as far as the true time falls. Source: Kim, Choi & Jang 2021, Eq. 6.

As printed, every piece has an interval of its own and its limit where it begins. That can be exploited: one long piece
from where the tool is quick jumps over all that is slow. ``formulation="printed"`` keeps it, to show so; by default
the pieces have one interval in common, and their limit in their middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.capability.geodesic import fastest_path
from paretoik.capability.model_evaluation import check_ends, evaluate_roots, linearise_pieces
from paretoik.capability.speed_models import SpeedModel
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import ArrayLike, check_size, shown
from paretoik.nlp.interval_program import IntervalSolver, Pieces

Formulation: TypeAlias = Literal["midpoint", "printed"]

PLACES = {"midpoint": 0.5, "printed": 0.0}  # share of a piece after which its limit is taken


@dataclass(frozen=True, kw_only=True)
class PlannerOptions:
    """Settings of the iterations of a plan."""

    iterations: int = 1000  # cone programs of a plan, at most
    time_tolerance: float = 1e-7  # share of the time to go that an iteration may still gain, or err by, at the end
    radius: float = 0.25  # of the distance to the target: how far a point may move in the first iteration


OPTIONS = PlannerOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """``points`` (pieces + 1, task) [m] from a position to the target, and the ``intervals`` (pieces,) [s] between.

    ``time_to_go`` [s] is what the plan claims, the sum of its intervals; ``velocity`` (task,) [m/s] leads along the
    first piece, as fast as the limit allows at its beginning. ``iterations`` counts the cone programs solved.
    """

    points: Float[np.ndarray, "points task"]
    intervals: Float[np.ndarray, " pieces"]
    velocity: Float[np.ndarray, " task"]
    iterations: int

    @property
    def time_to_go(self) -> float:
        """Sum of the intervals [s]."""
        return float(self.intervals.sum())


def fastest_plan(
    model: SpeedModel,
    position: ArrayLike,
    target: ArrayLike,
    *,
    horizon: int = 10,
    formulation: Formulation = "midpoint",
) -> Plan:
    """Return the plan of ``horizon`` pieces from ``position`` to ``target`` (task,) [m] that claims the least time.

    Source: Kim, Choi & Jang 2021, Eq. 6; ``formulation="printed"`` is that equation to the letter.

    Raises InvalidInput for ends that are not finite or outside the model's box, a horizon below 1, an unknown
    formulation, and a model that is not finite somewhere; SolverFailed where the iterations do not converge.
    """
    planner = Planner(model, horizon=horizon, formulation=formulation)
    first, last = check_ends(model, position, target)
    return planner.plan(planner.initial_points(first, last))


class Planner:
    """Plans for one model and horizon; the cone program is laid out once. Raises InvalidInput as ``fastest_plan``."""

    def __init__(self, model: SpeedModel, *, horizon: int, formulation: Formulation) -> None:
        check_size("horizon", horizon, 1)
        if formulation not in PLACES:
            raise InvalidInput(f"formulation: one of {', '.join(PLACES)} wanted, got {shown(formulation)}")
        self.model, self.horizon = model, horizon
        self._place, self._common = PLACES[formulation], formulation == "midpoint"
        self._solver = IntervalSolver(horizon, len(model.lower), common=self._common) if horizon > 1 else None

    def initial_points(self, start: Float[np.ndarray, " task"], target: Float[np.ndarray, " task"]) -> np.ndarray:
        """Return points (pieces + 1, task) to begin with: those of the fastest path, in as many pieces."""
        return fastest_path(self.model, start, target, intervals=self.horizon).points

    def shift(self, plan: Plan, position: Float[np.ndarray, " task"], period: float) -> np.ndarray:
        """Return points (pieces + 1, task) to begin the next plan with: what is remaining of one after a period."""
        count = self.horizon
        done = period / max(float(plan.intervals[0]), period)  # of the first piece
        remaining = done + (1 - done / count) * np.arange(count)
        remaining_points = [np.interp(remaining, np.arange(count + 1), column) for column in plan.points.T]
        return np.vstack([position, np.transpose(remaining_points)[1:], plan.points[-1]])

    def plan(self, points: Float[np.ndarray, "points task"]) -> Plan:
        """Return the best plan near these points, whose first and last stay. Raises SolverFailed if none is."""
        pieces = linearise_pieces(self.model, points, self._place)
        intervals, iterations = self._intervals(pieces), 0
        if self._solver is not None and intervals.any():
            points, intervals, iterations = self._improve(self._solver, points, pieces)
        return Plan(points=points, intervals=intervals, velocity=self._velocity(points), iterations=iterations)

    def _improve(
        self, solver: IntervalSolver, points: np.ndarray, pieces: Pieces
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Return points, intervals and the count of iterations.

        Source: Fletcher 1982, a model algorithm for composite nondifferentiable optimization problems.
        """
        intervals = self._intervals(pieces)
        radius = OPTIONS.radius * float(np.abs(points[-1] - points[0]).max())
        for count in range(1, OPTIONS.iterations + 1):
            inner, now = points[1:-1], float(intervals.sum())
            lower = np.clip(self.model.lower - inner, -radius, 0.0)
            upper = np.clip(self.model.upper - inner, 0.0, radius)
            solution = solver.solve(pieces, lower, upper)
            trial = points.copy()
            trial[1:-1] = np.clip(inner + solution.moves, self.model.lower, self.model.upper)
            trial_pieces = linearise_pieces(self.model, trial, self._place)
            predicted, actual = now - float(solution.intervals.sum()), now - float(self._intervals(trial_pieces).sum())
            if actual > 0.1 * predicted:
                points, pieces, intervals = trial, trial_pieces, self._intervals(trial_pieces)
            farthest = float(np.abs(solution.moves).max())
            if predicted <= OPTIONS.time_tolerance * now or (
                abs(predicted - actual) <= OPTIONS.time_tolerance * now and farthest < 0.99 * radius
            ):
                return points, intervals, count
            if actual < 0.25 * predicted:
                radius = farthest / 2
            elif actual > 0.75 * predicted and farthest > 0.99 * radius:
                radius *= 2
        where = " ".join(f"{number:.6g}" for number in points[0])
        raise SolverFailed(
            f"plan from [{where}] m: settled within {OPTIONS.iterations} iterations wanted, it still moves"
        )

    def _intervals(self, pieces: Pieces) -> Float[np.ndarray, " pieces"]:
        times: np.ndarray = np.linalg.norm(pieces.values, axis=1)
        return np.full_like(times, times.max()) if self._common else times

    def _velocity(self, points: np.ndarray) -> Float[np.ndarray, " task"]:
        """Return the velocity along the first piece that is one, at the limit where the plan begins.

        With the limit in the middle a plan begins as fast as it may be half a piece later; what is commanded has to
        keep the limit now.
        """
        change = points[1:] - points[:-1]
        far = np.abs(change).max(axis=1) > 1e-6 * np.abs(points - points[0]).max()
        if not far.any():
            return np.zeros(points.shape[1])
        along = change[int(np.argmax(far))]
        velocity: np.ndarray = along / np.linalg.norm(evaluate_roots(self.model, points[:1])[0][0] @ along)
        return velocity
