"""Time-optimal control by looking ahead: every period the fastest path to the target is planned, and its start taken.

Source: Kim, Choi & Jang 2021, Eqs. 6 and 7. ``planner`` makes the plans.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, get_args

import numpy as np
from jaxtyping import Float, Int

from paretoik.call_arguments import check_call
from paretoik.capability.geodesic import path_time
from paretoik.capability.model_evaluation import check_ends, check_inside, evaluate_roots
from paretoik.capability.path_runs import PathQuery, run_path
from paretoik.capability.planner import Formulation, Plan, Planner
from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import ArrayLike, check_choice, finite_array
from paretoik.tables import field_representation, html_representation
from paretoik.task.limits import LIMIT_TOLERANCE


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
