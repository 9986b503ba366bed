"""Collisions of the arm at the steps and between them: on a grid, not by the bounds of the search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from paretoik.formulations.closed_loop import ClosedLoopRun
from paretoik.robot.kinematics import link_nodes
from paretoik.runs.distribution import Executor
from paretoik.task.obstacles import clearance
from problems import marcos_2012
from studies.marcos_2012.tables import Starts
from studies.processes import run_each
from studies.reporting import Row

BETWEEN = 20  # times finer than the steps


def count_collisions(run: ClosedLoopRun, *, finer: int = BETWEEN) -> tuple[int, float]:
    """Return the number of points of a finer grid with a collision, and the longest step of a joint [rad]."""
    q, task = run.q, run.task
    share = np.linspace(0, 1, finer, endpoint=False)[:, None, None]
    between = (q[:-1] + share * (q[1:] - q[:-1])).reshape(-1, q.shape[1])
    distance = clearance(task.obstacles, link_nodes(task.arm, between), task.link_radius)
    return int(np.count_nonzero(distance <= 0)), float(np.abs(np.diff(q, axis=0)).max())


def collision_rows(
    printed: Sequence[tuple[str, ClosedLoopRun]],
    starts: Starts,
    *,
    steps: int,
    seed: int,
    executor: Executor | None = None,
) -> list[Row]:
    """Return the collisions of arms: as the paper reads, and by default."""
    rows = [_row("as printed, steps of any length", name, run) for name, run in printed]
    calls = {
        (f"{links}R, r = {distance}, w = 0.5",): partial(_run_bounded, links, distance, start, steps, seed)
        for (links, distance), start in starts.items()
    }
    runs = run_each(executor, calls)
    return rows + [_row("steps of at most 0.1 rad", name, run) for (name,), run in runs.items()]


def _run_bounded(links: int, distance: float, start: np.ndarray, steps: int, seed: int) -> ClosedLoopRun:
    return marcos_2012.loop(
        3 if links == 3 else 4, distance, weight=0.5, blocked=True, steps=steps, start=start, seed=seed
    ).run()


def _row(reading: str, name: str, run: ClosedLoopRun) -> Row:
    met, longest = count_collisions(run)
    return Row(
        table=f"points between steps where the arm meets an obstacle, {BETWEEN} a step",
        row=reading,
        column=name,
        unit="",
        ours=met,
        note=f"longest step of a joint {longest:.3g} rad",
    )
