"""Our motion of a seam: ``pk.plan`` at its defaults in its own process, warm, with seconds and peak memory."""

from __future__ import annotations

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

import paretoik as pk
from studies.benchmarks.seams.cells import CELLS
from studies.benchmarks.seams.ladder_graph import Cost
from studies.benchmarks.seams.seam_paths import SEAMS, path

WARM_SAMPLES = 26


@pk.objective(unit="rad²/s", form="integral")
def joint_rates(motion: pk.Motion) -> np.ndarray:
    """Return Σ q̇² at every sample."""
    squares: np.ndarray = (motion.dq**2).sum(axis=-1)
    return squares


OBJECTIVES = {"joint travel": pk.joint_travel, "joint rates": joint_rates}


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanResult:
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
