"""Time-optimal control by looking ahead: every period the fastest path to the target is planned, and its start taken.

A plan has a few pieces and, as unknowns, the points between them and the intervals that they take. The velocity limit
‖R v‖ ≤ 1 is made linear around the last path, again and again, which leaves second-order cone programs; a step is taken
as far as the true time gets less. Source: Kim, Choi & Jang 2021, Eqs. 6 and 7.

As printed, every piece has an interval of its own and its limit where it begins. That invites cheating: one long piece
from where the tool is quick jumps over all that is slow. ``formulation="printed"`` keeps it, to show so; by default
the pieces have one interval in common, and their limit in their middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.capability.geodesic import (
    check_ends,
    check_inside,
    fastest_path,
    known_roots,
    path_time,
    pieces_of,
)
from paretoik.capability.speed_models import SpeedModel
from paretoik.errors import InvalidInput, SolverFailed, check_size
from paretoik.inputs import ArrayLike, finite_array
from paretoik.nlp.interval_program import IntervalSolver, Pieces

Formulation: TypeAlias = Literal["midpoint", "printed"]

PLACES = {"midpoint": 0.5, "printed": 0.0}  # share of a piece that is done where its limit is taken
ITERATIONS = 1000  # of a plan
SETTLED = 1e-7  # of the time to go: what an iteration may still gain, or be mistaken by, at the end
REACH = 0.25  # of the distance to the target: how far a point may move in the first iteration
PATIENCE = 10.0  # times that the straight line takes: a reference still on its way then goes nowhere
BEYOND = 1e-9  # of the velocity limit: rounding, not counted as a cut


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


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeOptimalRun:
    """What time-optimal control did, sample by sample, a period apart.

    ``times`` (n,) [s]; ``references`` and ``positions`` of the tool (n, task) [m]; ``velocities`` (n − 1, task) [m/s]
    that were commanded and kept for a period each, ``cuts`` of them less than the controller asked for. Of each plan:
    its claimed time ``to_go`` (plans,) [s], the ``seconds`` it took and its ``iterations``. There is one for every
    period until the target is less than a period away. ``arrival`` [s] is when the reference stands on the target,
    ``settled`` [s] when the tool does, within the tolerance.
    """

    times: Float[np.ndarray, " n"]
    references: Float[np.ndarray, "n task"]
    positions: Float[np.ndarray, "n task"]
    velocities: Float[np.ndarray, "periods task"]
    cuts: int
    to_go: Float[np.ndarray, " plans"]
    seconds: Float[np.ndarray, " plans"]
    iterations: Int[np.ndarray, " plans"]
    arrival: float
    settled: float


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

    Raises
    ------
    InvalidInput
        For ends that are not finite or outside the model's box, a horizon below 1, an unknown formulation, and a model
        that is not finite somewhere.
    SolverFailed
        Where the iterations do not converge.
    """
    planner = Planner(model, horizon=horizon, formulation=formulation)
    first, last = check_ends(model, position, target)
    return planner.plan(planner.guess(first, last))


class Planner:
    """Plans for one model and horizon; the cone program is laid out once. Raises InvalidInput as ``fastest_plan``."""

    def __init__(self, model: SpeedModel, *, horizon: int, formulation: Formulation) -> None:
        check_size("horizon", horizon, 1)
        if formulation not in PLACES:
            raise InvalidInput(f"formulation: one of {', '.join(PLACES)} wanted, got {formulation!r}")
        self.model, self.horizon = model, horizon
        self._place, self._common = PLACES[formulation], formulation == "midpoint"
        self._solver = IntervalSolver(horizon, len(model.lower), common=self._common) if horizon > 1 else None

    def guess(self, start: Float[np.ndarray, " task"], target: Float[np.ndarray, " task"]) -> np.ndarray:
        """Return points (pieces + 1, task) to begin with: those of the fastest path, in as many pieces."""
        return fastest_path(self.model, start, target, intervals=self.horizon).points

    def ahead(self, plan: Plan, position: Float[np.ndarray, " task"], period: float) -> np.ndarray:
        """Return points (pieces + 1, task) to begin the next plan with: what is left of one after a period."""
        count = self.horizon
        done = period / max(float(plan.intervals[0]), period)  # of the first piece
        left = done + (1 - done / count) * np.arange(count)
        left_points = [np.interp(left, np.arange(count + 1), column) for column in plan.points.T]
        return np.vstack([position, np.transpose(left_points)[1:], plan.points[-1]])

    def plan(self, points: Float[np.ndarray, "points task"]) -> Plan:
        """Return the best plan near these points, whose first and last stay. Raises SolverFailed if none is."""
        pieces = pieces_of(self.model, points, self._place)
        intervals, iterations = self._intervals(pieces), 0
        if self._solver is not None and intervals.any():
            points, intervals, iterations = self._improved(self._solver, points, pieces)
        return Plan(points=points, intervals=intervals, velocity=self._velocity(points), iterations=iterations)

    def _improved(
        self, solver: IntervalSolver, points: np.ndarray, pieces: Pieces
    ) -> tuple[np.ndarray, np.ndarray, int]:
        """Return points, intervals and the count of iterations.

        Source: Fletcher 1982, a model algorithm for composite nondifferentiable optimization problems.
        """
        intervals = self._intervals(pieces)
        reach = REACH * float(np.abs(points[-1] - points[0]).max())
        for count in range(1, ITERATIONS + 1):
            inner, now = points[1:-1], float(intervals.sum())
            lower = np.clip(self.model.lower - inner, -reach, 0.0)
            upper = np.clip(self.model.upper - inner, 0.0, reach)
            found = solver.solve(pieces, lower, upper)
            trial = points.copy()
            trial[1:-1] = np.clip(inner + found.moves, self.model.lower, self.model.upper)
            then = pieces_of(self.model, trial, self._place)
            promised, gained = now - float(found.intervals.sum()), now - float(self._intervals(then).sum())
            if gained > 0.1 * promised:
                points, pieces, intervals = trial, then, self._intervals(then)
            farthest = float(np.abs(found.moves).max())
            if promised <= SETTLED * now or (abs(promised - gained) <= SETTLED * now and farthest < 0.99 * reach):
                return points, intervals, count
            if gained < 0.25 * promised:
                reach = farthest / 2
            elif gained > 0.75 * promised and farthest > 0.99 * reach:
                reach *= 2
        where = " ".join(f"{number:.6g}" for number in points[0])
        raise SolverFailed(f"plan from [{where}] m: settled within {ITERATIONS} iterations wanted, it still moves")

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
        velocity: np.ndarray = along / np.linalg.norm(known_roots(self.model, points[:1])[0][0] @ along)
        return velocity


def time_optimal_control(
    model: SpeedModel,
    start: ArrayLike,
    target: ArrayLike,
    *,
    horizon: int = 10,
    period: float = 1e-3,
    gain: float = 100.0,
    tolerance: float = 1e-6,
    formulation: Formulation = "midpoint",
    initial: ArrayLike | None = None,
) -> TimeOptimalRun:
    """Lead the tool from ``start`` to ``target`` (task,) [m] in the least time, planning anew every period.

    Each ``period`` [s] a plan from the reference p* to the target gives a velocity v*, and p* ← p* + period · v*; in
    the period in which the target can be reached p* lands on it. A controller commands v* + ``gain`` [1/s] (p* − p),
    cut to what the model allows where the tool is, from where the tool stands at first, ``initial`` or the start. When
    the reference has landed the controller alone goes on until the tool is within ``tolerance`` [m] of the target.

    The plant is the model itself: what is commanded is kept exactly for a period. Where the tool is, is fed back to the
    controller only; plans begin at the reference, so that ``arrival`` and ``to_go`` depend neither on
    ``initial`` nor on ``gain``, and say nothing about an arm that is slower than its model.

    Source: Kim, Choi & Jang 2021, Eqs. 6 and 7, with the gain, the cut and the two ends added.

    Raises
    ------
    InvalidInput
        For positions that are not finite or outside the model's box, a horizon below 1, a period or tolerance not
        above 0, a gain outside (0, 1 / period], an unknown formulation, and a model that is not finite somewhere.
    SolverFailed
        Where a plan does not converge, or the reference is still not there after ten times the straight line's time.
    """
    _check_settings(period=period, gain=gain, tolerance=tolerance)
    planner = Planner(model, horizon=horizon, formulation=formulation)
    first, last = check_ends(model, start, target)
    tool = first if initial is None else finite_array("initial", initial, first.shape)
    check_inside(model, "initial", tool)
    references, plans, seconds = _led(planner, first, last, period)
    positions, velocities, cuts = _followed(model, tool, references, period, gain, tolerance)
    times = period * np.arange(len(positions))
    return TimeOptimalRun(
        times=times,
        references=np.vstack([references, np.tile(last, (len(positions) - len(references), 1))]),
        positions=positions,
        velocities=velocities,
        cuts=cuts,
        to_go=np.array([plan.time_to_go for plan in plans]),
        seconds=np.array(seconds),
        iterations=np.array([plan.iterations for plan in plans], dtype=int),
        arrival=float(times[len(references) - 1]),
        settled=float(times[-1]),
    )


def _check_settings(*, period: float, gain: float, tolerance: float) -> None:
    for name, value in (("period", period), ("gain", gain), ("tolerance", tolerance)):
        if not 0 < finite_array(name, value, ()) < np.inf:
            raise InvalidInput(f"{name}: a finite number above 0 wanted, got {value}")
    if gain * period > 1.0 + BEYOND:
        raise InvalidInput(f"gain: at most 1 / period = {1 / period:g} 1/s wanted, got {gain:g}: it overshoots")


def _led(
    planner: Planner, start: np.ndarray, target: np.ndarray, period: float
) -> tuple[np.ndarray, list[Plan], list[float]]:
    """Return references (periods + 1, task) from start to target, the plans and the seconds that they took."""
    model, points = planner.model, [start]
    latest = PATIENCE * path_time(model, np.stack([start, target])) + period
    plans: list[Plan] = []
    seconds: list[float] = []
    while np.any(points[-1] != target):
        rest = target - points[-1]
        if np.linalg.norm(known_roots(model, points[-1])[0] @ rest) <= period:
            points.append(target)
            break
        if len(points) * period > latest:
            away = np.linalg.norm(rest)
            raise SolverFailed(f"reference: on the target within {latest:.4g} s wanted, it is {away:.4g} m away")
        begun = perf_counter()
        guess = planner.ahead(plans[-1], points[-1], period) if plans else planner.guess(start, target)
        plans.append(planner.plan(guess))
        seconds.append(perf_counter() - begun)
        # where pieces last less than a period, the way along the first leads past the next point, and maybe a wall
        points.append(np.clip(points[-1] + period * plans[-1].velocity, model.lower, model.upper))
    return np.stack(points), plans, seconds


def _followed(
    model: SpeedModel, tool: np.ndarray, references: np.ndarray, period: float, gain: float, tolerance: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return positions of the tool, the velocities commanded, and how many of them were cut."""
    positions, cuts = [tool], 0
    velocities: list[np.ndarray] = []
    ahead = np.diff(references, axis=0) / period
    while len(velocities) < len(ahead) or np.linalg.norm(references[-1] - tool) > tolerance:
        now = len(velocities)
        reference, leading = (references[now], ahead[now]) if now < len(ahead) else (references[-1], 0.0)
        wanted = leading + gain * (reference - tool)
        velocity = (np.clip(tool + period * wanted, model.lower, model.upper) - tool) / period
        velocity /= max(1.0, float(np.linalg.norm(known_roots(model, tool)[0] @ velocity)))
        cuts += bool(np.linalg.norm(wanted - velocity) > BEYOND * np.linalg.norm(wanted))
        positions.append(tool + period * velocity)
        velocities.append(velocity)
        if now >= len(ahead) and np.all(positions[-1] == tool):
            away = np.linalg.norm(references[-1] - tool)
            raise SolverFailed(f"tool: within {tolerance:g} m of the target wanted, it stands still at {away:.3g} m")
        tool = positions[-1]
    return np.stack(positions), np.reshape(velocities, (-1, len(tool))), cuts
