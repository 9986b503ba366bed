"""Time-optimal control by looking ahead: every period the fastest path to the target is planned, and its start taken.

Source: Kim, Choi & Jang 2021, Eqs. 6 and 7. ``planner`` makes the plans.
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
    check_ends,
    check_inside,
    evaluate_roots,
    fastest_path,
    linearise_pieces,
    path_time,
)
from paretoik.capability.path_runs import PathQuery, run_path
from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import ArrayLike, check_call, check_choice, check_size, finite_array, shown
from paretoik.nlp.convex_programs import IntervalSolver, Pieces
from paretoik.tables import field_representation, html_representation
from paretoik.task.limits import LIMIT_TOLERANCE

# Plans of time-optimal control: the fastest path to the target in a few pieces, by second-order cone programs.
#
# The unknowns of a plan are the points between its pieces and the intervals that they take. The velocity limit ‖R v‖
# ≤ 1 is linearised around the last path, again and again, which leaves second-order cone programs; a step is taken as
# far as the true time falls. Source: Kim, Choi & Jang 2021, Eq. 6.
#
# As printed, every piece has an interval of its own and its limit where it begins. That can be exploited: one long
# piece from where the tool is quick jumps over all that is slow. ``formulation="printed"`` keeps it, to show so; by
# default the pieces have one interval in common, and their limit in their middle.


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


@check_call
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

    __repr__ = field_representation
    _repr_html_ = html_representation


@check_call
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
    """Lead the tool from ``start`` to ``target`` (task,) [m] in the least time, planning anew every period.

    Each ``period`` [s] a plan from the reference p* to the target gives a velocity v*, and p* ← p* + period · v*; in
    the period in which the target can be reached p* lands on it. A controller commands v* + ``gain`` [1/s] (p* − p),
    cut to what the model allows where the tool is, from where the tool stands at first, ``initial`` or the start. When
    the reference has landed the controller alone goes on until the tool is within ``tolerance`` [m] of the target.

    The plant is the model itself: commands hold exactly for a period. The tool's position is fed back to the controller
    only; plans begin at the reference, so that ``arrival`` and ``to_go`` depend neither on ``initial`` nor on ``gain``,
    and say nothing about an arm that is slower than its model.

    ``out`` is a folder to keep the run in: run.json, tool_path.npz with every array of the result, review.rrd, in which
    the tool moves along its path, and picture.png. ``overwrite`` allows it to replace a run that is there. ``observe``
    is called with a ``RunProgress`` while something is compiled or saved; as for ``plan``.

    Source: Kim, Choi & Jang 2021, Eqs. 6 and 7, with the gain, the cut and the two ends added.

    Raises InvalidInput for positions that are not finite or outside the model's box, a horizon below 1, a period or
    tolerance not above 0, a gain outside (0, 1 / period], an unknown formulation, and a model that is not finite
    somewhere; SolverFailed where a plan does not converge, or the reference is still not there after ten times the
    straight line's time.
    """
    check_model(model)
    check_choice("formulation", formulation, get_args(Formulation))
    for name, value in (("period", period), ("gain", gain), ("tolerance", tolerance)):
        if not 0 < finite_array(name, value, ()) < np.inf:
            raise InvalidInput(f"{name}: a finite number above 0 wanted, got {value}")
    if gain * period > 1.0 + LIMIT_TOLERANCE:
        raise InvalidInput(f"gain: at most 1 / period = {1 / period:g} 1/s wanted, got {gain:g}: it overshoots")
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
    return run_path(
        query,
        lambda: _control(planner, first, last, tool, period=period, gain=gain, tolerance=tolerance),
        out=out,
        overwrite=overwrite,
        observe=observe,
    )


def _control(
    planner: Planner,
    first: np.ndarray,
    last: np.ndarray,
    tool: np.ndarray,
    *,
    period: float,
    gain: float,
    tolerance: float,
) -> TimeOptimalRun:
    """Return what the control does; raises SolverFailed as ``time_optimal_control`` says."""
    references, plans, seconds = _reference(planner, first, last, period)
    positions, velocities, cuts = _track(planner.model, tool, references, period, gain, tolerance)
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


def _reference(
    planner: Planner, start: np.ndarray, target: np.ndarray, period: float, *, time_limit: float = 10.0
) -> tuple[np.ndarray, list[Plan], list[float]]:
    """Return references (periods + 1, task) from start to target, the plans and the seconds that they took.

    After ``time_limit`` times the straight line's time a reference is taken to lead nowhere.
    """
    model, points = planner.model, [start]
    latest = time_limit * path_time(model, np.stack([start, target])) + period
    plans: list[Plan] = []
    seconds: list[float] = []
    while np.any(points[-1] != target):
        remaining = target - points[-1]
        if np.linalg.norm(evaluate_roots(model, points[-1])[0] @ remaining) <= period:
            points.append(target)
            break
        if len(points) * period > latest:
            away = np.linalg.norm(remaining)
            raise SolverFailed(f"reference: on the target within {latest:.4g} s wanted, it is {away:.4g} m away")
        began = perf_counter()
        guess = planner.shift(plans[-1], points[-1], period) if plans else planner.initial_points(start, target)
        plans.append(planner.plan(guess))
        seconds.append(perf_counter() - began)
        # where pieces last less than a period, the way along the first leads past the next point, and maybe a wall
        points.append(np.clip(points[-1] + period * plans[-1].velocity, model.lower, model.upper))
    return np.stack(points), plans, seconds


def _track(
    model: SpeedModel, tool: np.ndarray, references: np.ndarray, period: float, gain: float, tolerance: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return positions of the tool, the velocities commanded, and how many of them were cut."""
    positions, cuts = [tool], 0
    velocities: list[np.ndarray] = []
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
            raise SolverFailed(f"tool: within {tolerance:g} m of the target wanted, it stands still at {away:.3g} m")
        tool = positions[-1]
    return np.stack(positions), np.reshape(velocities, (-1, len(tool))), cuts
