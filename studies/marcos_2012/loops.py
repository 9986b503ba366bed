"""Every closed loop of the tables, searched and exact, on all cores."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context

import numpy as np

from paretoik.closed_loop.exact_loop import exact_steps
from paretoik.closed_loop.loop import StepRecord
from paretoik.formulations.closed_loop_result import ClosedLoopRun
from paretoik.task.motion import Motion
from problems import marcos_2012
from problems.marcos_2012 import DISTANCES, STEPS, Links

WEIGHTS = tuple(round(0.1 * k, 1) for k in range(11))
LINKS: tuple[Links, ...] = (4, 3)  # the longer runs first, so that all cores end together


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of Tables 1 and 2, or with obstacles of Tables 3 and 4."""

    links: Links
    distance: float
    blocked: bool
    weight: float

    @property
    def arm(self) -> str:
        """The arm as the paper's columns call it."""
        return f"{self.links}R"

    @property
    def row(self) -> str:
        """The row as the paper's numbers are kept."""
        return f"r = {self.distance}, w = {self.weight}"


@dataclass(frozen=True, kw_only=True, eq=False)
class CellLoop:
    """A cell's closed loop, searched, its seconds of processor time, and the exact motion from the same start."""

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


def find_starts(selection: Sequence[Cell], *, seed: int) -> dict[tuple[int, float], np.ndarray]:
    """Return where each arm begins on each circle, by OLGA, clear of the obstacles: the same with and without them."""
    pairs = list(dict.fromkeys((cell.links, cell.distance) for cell in selection))
    if len(pairs) == 1:
        return {pairs[0]: _start(*pairs[0], seed)}
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return dict(zip(pairs, pool.map(_start, *zip(*pairs, strict=True), [seed] * len(pairs)), strict=True))


def _start(links: Links, distance: float, seed: int) -> np.ndarray:
    return marcos_2012.loop(links, distance, blocked=True, steps=3, seed=seed).start


def follow_all(
    selection: Sequence[Cell], postures: dict[tuple[int, float], np.ndarray], *, steps: int = STEPS, seed: int = 0
) -> Iterator[CellLoop]:
    """Follow every cell's loop on all cores, as they end; how many of all steps are done is said every second."""
    ended, done, last_message, total = 0, 0, time.perf_counter(), steps * len(selection)

    def count(_: StepRecord) -> None:
        nonlocal done, last_message
        done += 1  # of threads that count at once one may be lost: it is said, not reckoned with
        if time.perf_counter() > last_message + 1.0:
            last_message = time.perf_counter()
            print(
                f"\r{done} of {total} steps, {ended} of {len(selection)} closed loops",
                end="",
                file=sys.stderr,
                flush=True,
            )

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for one in pool.map(
            lambda cell: follow(cell, postures[cell.links, cell.distance], steps=steps, seed=seed, observe=count),
            selection,
        ):
            ended += 1
            yield one
    print(f"\r{total} of {total} steps, {ended} of {len(selection)} closed loops", file=sys.stderr)


def follow(
    cell: Cell,
    start: np.ndarray,
    *,
    steps: int,
    seed: int,
    generations: int = 200,
    warm_start: bool = False,
    observe: Callable[[StepRecord], object] | None = None,
) -> CellLoop:
    """Follow one cell's loop from a start, searched and exact; ``observe`` is called with every step searched."""
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
    run = loop.run(fronts=(1, 2), observe=observe)
    seconds = time.thread_time() - started
    q = exact_steps(loop.task, start, weight=cell.weight, longest_step=loop.longest)
    return CellLoop(cell=cell, run=run, seconds=seconds, exact=loop.task.motion(q))
