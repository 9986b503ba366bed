"""Every closed loop of the tables, searched and exact, each a task of its own."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from paretoik.formulations.closed_loop import ClosedLoopRun
from paretoik.runs.distribution import Executor
from paretoik.task.motion import Motion
from problems import marcos_2012
from problems.marcos_2012 import DISTANCES, STEPS, Links
from studies.marcos_2012.exact_loop import exact_steps
from studies.processes import run_each

WEIGHTS = tuple(round(0.1 * k, 1) for k in range(11))
LINKS: tuple[Links, ...] = (4, 3)  # longer runs first, so that all cores end together


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of Tables 1 and 2, or with obstacles of Tables 3 and 4."""

    links: Links
    distance: float
    blocked: bool
    weight: float

    @property
    def arm(self) -> str:
        """The arm's name in the paper's columns."""
        return f"{self.links}R"

    @property
    def row(self) -> str:
        """The row's name among the paper's numbers."""
        return f"r = {self.distance}, w = {self.weight}"


@dataclass(frozen=True, kw_only=True, eq=False)
class CellLoop:
    """A cell's closed loop, searched, its processor seconds, and the exact motion from the same start."""

    cell: Cell
    run: ClosedLoopRun
    seconds: float
    exact: Motion


def cells(
    *, links: Sequence[Links] = LINKS, distances: Sequence[float] = DISTANCES, weights: Sequence[float] = WEIGHTS
) -> list[Cell]:
    """Return the cells of these arms, distances and weights, with and without obstacles."""
    return [
        Cell(links=n, distance=r, blocked=blocked, weight=w)
        for n, blocked, r, w in product(links, (False, True), distances, weights)
    ]


def find_starts(
    selection: Sequence[Cell], *, seed: int, executor: Executor | None = None
) -> dict[tuple[int, float], np.ndarray]:
    """Return each arm's start on each circle, by OLGA, clear of the obstacles: the same with and without them."""
    pairs = dict.fromkeys((cell.links, cell.distance) for cell in selection)
    calls = {(f"{links}R", f"r = {distance}"): partial(_start, links, distance, seed) for links, distance in pairs}
    return dict(zip(pairs, run_each(executor if len(calls) > 1 else None, calls).values(), strict=True))


def _start(links: Links, distance: float, seed: int) -> np.ndarray:
    return marcos_2012.loop(links, distance, blocked=True, steps=3, seed=seed).start


def follow_all(
    selection: Sequence[Cell],
    postures: Mapping[tuple[int, float], np.ndarray],
    *,
    steps: int = STEPS,
    seed: int = 0,
    executor: Executor | None = None,
) -> list[CellLoop]:
    """Follow every cell's loop and print the progress."""
    calls = {
        (cell.arm, cell.row, "blocked" if cell.blocked else "free"): partial(
            follow, cell, postures[cell.links, cell.distance], steps=steps, seed=seed
        )
        for cell in selection
    }
    return list(run_each(executor, calls).values())


def follow(
    cell: Cell,
    start: np.ndarray,
    *,
    steps: int,
    seed: int,
    generations: int = 200,
    warm_start: bool = False,
) -> CellLoop:
    """Follow one cell's loop from a start, searched and exact."""
    loop = marcos_2012.loop(
        cell.links,
        cell.distance,
        weight=cell.weight,
        blocked=cell.blocked,
        steps=steps,
        start=start,
        seed=seed,
        generations=generations,
        as_printed=True,
        warm_start=warm_start,
    )
    started = time.thread_time()
    run = loop.run(fronts=(1, 2))
    seconds = time.thread_time() - started
    q = exact_steps(loop.task, start, weight=cell.weight, longest_step=loop.longest)
    return CellLoop(cell=cell, run=run, seconds=seconds, exact=loop.task.motion(q))
