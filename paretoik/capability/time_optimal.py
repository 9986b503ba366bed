"""Time-optimal control: plan the fastest path in every period, and follow its start.

Source: Kim, Choi & Jang 2021, Eqs. 6 and 7. ``Planner`` makes the plans.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float, Int

from paretoik.capability.geodesic import (
    PathQuery,
    check_ends,
    check_inside,
    evaluate_roots,
    fastest_path,
    linearise_pieces,
    path_time,
    run_path,
)
from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import ArrayLike, check_choice, check_size, finite_array
from paretoik.nlp.convex_programs import IntervalSolver, Pieces
from paretoik.tables import represented
from paretoik.task.limits import LIMIT_TOLERANCE

# Plans of time-optimal control: the fastest path to the target in a few pieces, by second-order cone programs.


Formulation: TypeAlias = Literal["midpoint", "printed"]


@dataclass(frozen=True, kw_only=True)
class PlannerOptions:
    """Settings of the iterations of a plan."""

    iterations: int = 1000  # largest number of cone programs per plan
    time_tolerance: float = 1e-7  # share of the time to go: largest gain or error of the last iteration
    radius: float = 0.25  # share of the distance to the target: largest move of a point in the first iteration


OPTIONS = PlannerOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """A plan from a position to the target.

    points: points (pieces + 1, task) from the position to the target [m]
    intervals: times (pieces,) between the points [s]
    velocity: velocity (task,) along the first piece [m/s], as fast as the limit allows at its beginning
    iterations: number of cone programs solved
    """

    points: Float[np.ndarray, "points task"]
    intervals: Float[np.ndarray, " pieces"]
    velocity: Float[np.ndarray, " task"]
    iterations: int

    @property
    def time_to_go(self) -> float:
        """Planned time [s] to the target: the sum of the intervals."""
        return float(self.intervals.sum())


class Planner:
    """Plans of the least time for one model, in ``horizon`` pieces.

    The unknowns are the points between the pieces and the intervals. The velocity limit ‖R v‖ ≤ 1 is linearised around
    the last path within a trust region in each iteration, which solves a second-order cone program.

    Source: Kim, Choi & Jang 2021, Eq. 6; the formulation "printed" is exactly that equation. There every piece has its
    own interval and the limit at its beginning: one long piece from a position of high speed can jump over all
    positions of low speed. With "midpoint" the pieces have one common interval and the limits at their midpoints.
    """

    def __init__(self, model: SpeedModel, *, horizon: int, formulation: Formulation) -> None:
        check_size("horizon", horizon, 1)
        self.model, self.horizon = model, horizon
        self._common = formulation == "midpoint"
        self._share = 0.5 if self._common else 0.0  # share of a piece at which its limit is evaluated
        self._solver = IntervalSolver(horizon, len(model.lower), common=self._common) if horizon > 1 else None

    def initial_points(self, start: Float[np.ndarray, " task"], target: Float[np.ndarray, " task"]) -> np.ndarray:
        """Return initial points (pieces + 1, task) of the fastest path."""
        return fastest_path(self.model, start, target, intervals=self.horizon).points

    def shift(self, plan: Plan, position: Float[np.ndarray, " task"], period: float) -> np.ndarray:
        """Return initial points (pieces + 1, task) of the next plan: the rest of the last plan after a period."""
        count = self.horizon
        done = period / max(float(plan.intervals[0]), period)  # share of the first piece
        remaining = done + (1 - done / count) * np.arange(count)
        remaining_points = [np.interp(remaining, np.arange(count + 1), column) for column in plan.points.T]
        return np.vstack([position, np.transpose(remaining_points)[1:], plan.points[-1]])

    def plan(self, points: Float[np.ndarray, "points task"]) -> Plan:
        """Return the best plan near ``points``; the first and the last point stay fixed.

        Raises SolverFailed if the iterations do not converge, or Clarabel finds no solution. Source: Fletcher 1982, A
        model algorithm for composite nondifferentiable optimization problems.
        """
        pieces = linearise_pieces(self.model, points, self._share)
        intervals, iterations = self._intervals(pieces), 0
        settled = not intervals.any()
        radius = OPTIONS.radius * float(np.abs(points[-1] - points[0]).max())
        while (solver := self._solver) is not None and not settled:
            if iterations == OPTIONS.iterations:
                where = " ".join(f"{number:.6g}" for number in points[0])
                raise SolverFailed(
                    f"plan from [{where}] m: must converge within {OPTIONS.iterations} iterations, got more"
                )
            iterations += 1
            inner, now = points[1:-1], float(intervals.sum())
            lower = np.clip(self.model.lower - inner, -radius, 0.0)
            upper = np.clip(self.model.upper - inner, 0.0, radius)
            solution = solver.solve(pieces, lower, upper)
            trial = points.copy()
            trial[1:-1] = np.clip(inner + solution.moves, self.model.lower, self.model.upper)
            trial_pieces = linearise_pieces(self.model, trial, self._share)
            predicted, actual = now - float(solution.intervals.sum()), now - float(self._intervals(trial_pieces).sum())
            if actual > 0.1 * predicted:
                points, pieces, intervals = trial, trial_pieces, self._intervals(trial_pieces)
            farthest = float(np.abs(solution.moves).max())
            settled = predicted <= OPTIONS.time_tolerance * now or (
                abs(predicted - actual) <= OPTIONS.time_tolerance * now and farthest < 0.99 * radius
            )
            if actual < 0.25 * predicted:
                radius = farthest / 2
            elif actual > 0.75 * predicted and farthest > 0.99 * radius:
                radius *= 2
        # The velocity is along the first piece with a length, as fast as the limit at the plan's beginning allows. The
        # plan itself may begin faster, if its limits are at midpoints.
        change, velocity = points[1:] - points[:-1], np.zeros(points.shape[1])
        far = np.abs(change).max(axis=1) > 1e-6 * np.abs(points - points[0]).max()
        if far.any():
            along = change[int(np.argmax(far))]
            velocity = along / np.linalg.norm(evaluate_roots(self.model, points[:1])[0][0] @ along)
        return Plan(points=points, intervals=intervals, velocity=velocity, iterations=iterations)

    def _intervals(self, pieces: Pieces) -> Float[np.ndarray, " pieces"]:
        times: np.ndarray = np.linalg.norm(pieces.values, axis=1)
        return np.full_like(times, times.max()) if self._common else times


# The control loop: it plans in every period.


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class TimeOptimalRun:
    """Result of time-optimal control, in samples one period apart.

    times: times (n,) of the samples [s]
    references: references (n, task) of the tool [m]
    positions: positions (n, task) of the tool [m]
    velocities: commanded velocities (n − 1, task) [m/s], each for one period
    cuts: number of commands cut below the controller's request
    to_go: planned time (plans,) to the target [s]; none is planned less than one period away from it
    seconds: computing time (plans,) of each plan [s]
    iterations: number of cone programs (plans,) of each plan
    arrival: time at which the reference reaches the target [s]
    settled: time at which the tool reaches it within the tolerance [s]
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
    out: str | Path | None = None,
    overwrite: bool = False,
    observe: Callable[[Any], object] | bool | None = None,
) -> TimeOptimalRun:
    """Move the tool to ``target`` in the least time, with a new plan every period.

    In each period, a plan from the reference p* to the target gives a velocity v*, and p* ← p* + period · v*; p* goes
    to the target if it can be reached within the period. A controller commands v* + gain (p* − p), cut to what the
    model allows at the tool's position. After the reference has arrived, only the controller continues, until the tool
    is within ``tolerance`` of the target.

    The plant is the model itself: the tool follows commands exactly. The tool's position is fed back to the controller
    only; plans begin at the reference, so that ``arrival`` and ``to_go`` depend neither on ``initial`` nor on ``gain``,
    and say nothing about an arm that is slower than its model.
    Source: Kim, Choi & Jang 2021, Eqs. 6 and 7. The gain, the cut and both criteria of arrival are added.

    model: model of the tool's speed
    start: first reference (task,) [m]
    target: target (task,) of the tool [m]
    horizon: number of pieces of a plan, at least 1
    period: time from one plan to the next [s]
    gain: gain of the controller [1/s], at most 1 / period
    tolerance: distance from the target [m] at which the control ends
    formulation: formulation of the plans, "midpoint" or "printed", as in ``Planner``
    initial: first position (task,) of the tool [m]; None: the start
    out: folder for the run: run.json, tool_path.npz with every array of the result, review.rrd, in which the tool moves
        along its path, and picture.png
    overwrite: whether to replace a run in ``out``
    observe: function that is called with a ``RunProgress`` while something is compiled or saved, as for ``plan``

    Raises InvalidInput for positions that are not finite or outside the model's box, a horizon below 1, a period or
    tolerance not above 0, a gain outside (0, 1 / period], an unknown formulation, and a model that is not finite
    somewhere; SolverFailed if a plan does not converge, or the reference has not arrived after ten times the straight
    line's time, or the tool stops.
    """
    check_model(model)
    check_choice("formulation", formulation, get_args(Formulation))
    for name, value in (("period", period), ("gain", gain), ("tolerance", tolerance)):
        if not 0 < finite_array(name, value, ()) < np.inf:
            raise InvalidInput(f"{name} must be a finite number above 0, got {value}")
    if gain * period > 1.0 + LIMIT_TOLERANCE:
        raise InvalidInput(
            f"gain must be at most 1 / period = {1 / period:g} 1/s, got {gain:g}; a larger gain overshoots"
        )
    planner = Planner(model, horizon=horizon, formulation=formulation)
    first, last = check_ends(model, start, target)
    tool = first if initial is None else finite_array("initial", initial, first.shape)
    check_inside(model, "initial", tool)
    settings = {
        "horizon": int(horizon),
        "period": float(period),
        "gain": float(gain),
        "tolerance": float(tolerance),
        "formulation": formulation,
        "initial": None if initial is None else tool.tolist(),
    }
    query = PathQuery(verb="time_optimal_control", model=model, start=first, target=last, settings=settings)

    def control() -> TimeOptimalRun:
        references, plans, seconds = _reference(planner, first, last, period)
        positions, velocities, cuts = _track(model, tool, references, period, gain, tolerance)
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

    return run_path(query, control, out=out, overwrite=overwrite, observe=observe)


def _reference(
    planner: Planner, start: np.ndarray, target: np.ndarray, period: float
) -> tuple[np.ndarray, list[Plan], list[float]]:
    """Return references (periods + 1, task) from start to target, plans and computing times [s]."""
    model, points = planner.model, [start]
    latest = 10.0 * path_time(model, np.stack([start, target])) + period
    plans, seconds = list[Plan](), list[float]()
    while np.any(points[-1] != target):
        remaining = target - points[-1]
        if np.linalg.norm(evaluate_roots(model, points[-1])[0] @ remaining) <= period:
            points.append(target)
            break
        if len(points) * period > latest:
            away = np.linalg.norm(remaining)
            raise SolverFailed(f"reference must be on the target within {latest:.4g} s, got {away:.4g} m away")
        began = perf_counter()
        guess = planner.shift(plans[-1], points[-1], period) if plans else planner.initial_points(start, target)
        plans.append(planner.plan(guess))
        seconds.append(perf_counter() - began)
        # if pieces last less than a period, the step passes the next point, and perhaps a bound of the box
        points.append(np.clip(points[-1] + period * plans[-1].velocity, model.lower, model.upper))
    return np.stack(points), plans, seconds


def _track(
    model: SpeedModel, tool: np.ndarray, references: np.ndarray, period: float, gain: float, tolerance: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return tool positions, commanded velocities, and the number of cuts."""
    positions, velocities, cuts = [tool], list[np.ndarray](), 0
    ahead = np.diff(references, axis=0) / period
    while len(velocities) < len(ahead) or np.linalg.norm(references[-1] - tool) > tolerance:
        now = len(velocities)
        reference, feedforward = (references[now], ahead[now]) if now < len(ahead) else (references[-1], 0.0)
        command = feedforward + gain * (reference - tool)
        velocity = (np.clip(tool + period * command, model.lower, model.upper) - tool) / period
        velocity /= max(1.0, float(np.linalg.norm(evaluate_roots(model, tool)[0] @ velocity)))
        cuts += bool(np.linalg.norm(command - velocity) > LIMIT_TOLERANCE * np.linalg.norm(command))
        positions.append(tool + period * velocity)
        velocities.append(velocity)
        if now >= len(ahead) and np.all(positions[-1] == tool):
            away = np.linalg.norm(references[-1] - tool)
            raise SolverFailed(f"tool must come within {tolerance:g} m of the target, but stopped {away:.3g} m away")
        tool = positions[-1]
    return np.stack(positions), np.reshape(velocities, (-1, len(tool))), cuts
