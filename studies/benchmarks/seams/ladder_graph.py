"""A ladder graph: all postures of each sample over a grid of tool angles, and the exact shortest path; our plan.

This is Descartes' method (De Maeyer, Moyaers & Demeester 2017), on the same cost as ours and without storing edges: the
least cost to reach every posture, sample by sample (Bellman 1957). To its advantage, angles of joints with a whole turn
of range count modulo a turn, and their limits do not count.
"""

from __future__ import annotations

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from typing import Literal, NamedTuple

import numpy as np

import paretoik as pk
from paretoik.compilation.numba_cache import compiled
from studies.benchmarks.seams.cells import CELLS, SEAMS, Cell, path

Cost = Literal["joint travel", "joint rates"]
TURN = 2 * np.pi


class Ladder(NamedTuple):
    """The shortest path: ``cost``, and postures ``q`` (samples, dof; None without a path)."""

    cost: float
    q: np.ndarray | None


def shortest_path(cell: Cell, times: np.ndarray, frames: np.ndarray, resolution: float, cost: Cost) -> Ladder:
    """Return the shortest path through the postures over tool angles ``resolution`` [rad] apart."""
    whole_turn = _whole_turn(cell)
    rungs = [postures_at(cell, frame, resolution) for frame in frames]
    turn = np.where(whole_turn, TURN, 0.0)
    costs, origins = np.zeros(len(rungs[0])), []
    for k, step in enumerate(np.diff(times)):
        furthest = np.asarray(cell.arm.velocity_limits) * step * (1 + 1e-9)
        weight = 1.0 / step if cost == "joint rates" else 0.0
        costs, origin = _extend(costs, rungs[k], rungs[k + 1], turn, furthest, weight)
        origins.append(origin)
    if not np.isfinite(costs).any():
        return Ladder(cost=np.inf, q=None)
    vertices = [int(np.argmin(costs))]
    for origin in reversed(origins):
        vertices.insert(0, int(origin[vertices[0]]))
    q = np.stack([rung[vertex] for rung, vertex in zip(rungs, vertices, strict=True)])
    q[:, whole_turn] = np.unwrap(q[:, whole_turn], axis=0)
    return Ladder(cost=float(costs.min()), q=q)


def postures_at(cell: Cell, frame: np.ndarray, resolution: float) -> np.ndarray:
    """Return the postures of a sample within limits, over all tool angles (postures, dof)."""
    lower, upper = np.asarray(cell.arm.position_limits).T
    angles = np.linspace(0.0, TURN, round(TURN / resolution), endpoint=False)
    turned = np.tile(frame, (len(angles), 1, 1))
    cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
    turned[:, :3, 0] = cosines * frame[:3, 0] + sines * frame[:3, 1]
    turned[:, :3, 1] = cosines * frame[:3, 1] - sines * frame[:3, 0]
    values = cell.grid(resolution)
    q = np.concatenate([cell.postures(turned, float(value)).reshape(-1, cell.arm.dof) for value in values])
    q = q[~np.isnan(q).any(axis=1)]
    q = np.where(cell.revolute, (q + np.pi) % TURN - np.pi, q)
    return np.ascontiguousarray(q[((q >= lower) & (q <= upper) | _whole_turn(cell)).all(axis=1)])


def _whole_turn(cell: Cell) -> np.ndarray:
    """Return which joints can turn a whole turn (dof,)."""
    lower, upper = np.asarray(cell.arm.position_limits).T
    mask: np.ndarray = (upper - lower >= TURN) & cell.revolute
    return mask


@compiled(what="the ladder graph", seconds=1, level=3)
def _extend(costs, before, after, turn, furthest, weight):  # type: ignore[no-untyped-def]
    """Return the least cost to reach each posture of the next sample, and the posture before it.

    An edge costs the sum of the joints' ways, or with a weight that of their squares times the weight.
    """
    count, dof = after.shape
    least, origin = np.full(count, np.inf), np.zeros(count, dtype=np.int64)
    for i in range(count):
        for j in range(len(before)):
            cost, allowed = costs[j], np.isfinite(costs[j])
            for joint in range(dof):
                step = abs(after[i, joint] - before[j, joint])
                if turn[joint] > 0:
                    step = min(step, turn[joint] - step)
                if step > furthest[joint]:
                    allowed = False
                    break
                cost += weight * step * step if weight > 0 else step
            if allowed and cost < least[i]:
                least[i], origin[i] = cost, j
    return least, origin


WARM_SAMPLES = 26


@pk.objective(unit="rad²/s", form="integral")
def joint_rates(motion: pk.Motion) -> np.ndarray:
    """Return Σ q̇² at every sample."""
    squares: np.ndarray = (motion.dq**2).sum(axis=-1)
    return squares


OBJECTIVES = {"joint travel": pk.joint_travel, "joint rates": joint_rates}


class PlanResult(NamedTuple):
    """The best motion's postures ``q`` (samples, dof), seconds of ``plan``, and the process's peak memory [GB]."""

    q: np.ndarray | None
    seconds: float
    gigabytes: float
    message: str = ""


def plan_seam(cell: str, seam: str, samples: int, cost: Cost) -> PlanResult:
    """Return the result of ``pk.plan``, in a new process that has planned a coarser seam before."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as worker:
        return worker.submit(_solve, cell, seam, samples, cost).result()


def _solve(cell: str, seam: str, samples: int, cost: Cost) -> PlanResult:
    def plan(count: int, cost: Cost) -> np.ndarray:
        times, frames = SEAMS[seam](count, cell)
        task = pk.Task(path(times, frames), axes="xyz+z-axis")
        problem = pk.Tracking(
            CELLS[cell]().arm, task, objectives=[OBJECTIVES[cost]], differences="backward", cyclic=False
        )
        q: np.ndarray = pk.plan(problem).best.motion.q
        return q

    with suppress(pk.Infeasible):
        plan(WARM_SAMPLES, "joint rates")
    begin = time.perf_counter()
    q: np.ndarray | None
    try:
        q, message = plan(samples, cost), ""
    except pk.ParetoikError as error:
        q, message = None, str(error)
    seconds = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    return PlanResult(q=q, seconds=seconds, gigabytes=peak, message=message)
