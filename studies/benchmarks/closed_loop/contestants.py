"""A control step's search by the engine, by pymoo, by pymoo with a compiled evaluation, and by pygmo."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from pymoo.optimize import minimize

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.configurations import configurations
from paretoik.closed_loop.step import ControlStep, Instant
from paretoik.formulations.closed_loop import ClosedLoop
from problems import marcos_2012
from problems.marcos_2012 import Links

GENERATIONS = 200
PYGMO = find_spec("pygmo") is not None
FRONT = np.ndarray


def loop_of(links: Links) -> ClosedLoop:
    """Return the paper's loop, without obstacles, from a start on the circle."""
    small = marcos_2012.loop(links, 0.7, start=None, steps=400, as_printed=True)
    return small.changed(start=near_circle(small))


def near_circle(loop: ClosedLoop) -> np.ndarray:
    """Return joint positions with the tool where the circle begins, from a bent arm by Newton's method."""
    q = np.linspace(0.3, 1.0, loop.task.arm.dof)
    for _ in range(50):
        instant = loop.changed(start=q).instant(1)
        wanted, jacobian = instant.asked()
        missed = wanted - (loop.task.targets[1] - loop.task.targets[0])
        q = q + np.linalg.pinv(jacobian) @ missed
    return q


class CompiledStep(ControlStep):
    """The same pymoo problem, its genes and objectives evaluated by the engine's compiled code, all at once."""

    def __init__(self, loop: ClosedLoop, instant: Instant) -> None:
        super().__init__(instant, loop.objectives)
        self.search = loop.search()
        self.search(instant)  # what does not change during a step is now in its room
        self.place, _ = self.search.situation(instant)

    def scored(self, X: np.ndarray) -> np.ndarray:
        """Return the objectives of genes."""
        room, n = self.search.room, self.row - 1
        room.children[:, : len(X)] = X.T
        configurations(room.children, 0, len(X), self.place, room.work, room.given)
        for j in range(n):
            room.given[n + j, : len(X)] = (room.given[j, : len(X)] - self.place.previous[j]) / self.place.dt
        run_first(self.search.programs.objectives.arrays, room.given, room.values, len(X))
        F: np.ndarray = room.values[:, : len(X)].T.copy()
        return np.where(np.isfinite(F).all(axis=1)[:, None], F, np.inf)

    def free(self, genes: np.ndarray) -> Any:
        """Return that every chromosome is: there are no obstacles and no bounds."""
        return np.ones(len(genes), dtype=bool)

    def shortened(self, genes: np.ndarray) -> np.ndarray:
        """Return genes as they are."""
        return genes

    def _evaluate(self, X: np.ndarray, out: dict[str, object], *args: object, **kwargs: object) -> None:
        out["F"], out["G"] = self.scored(X), -np.ones((len(X), 1))


def engine(loop: ClosedLoop, instant: Instant) -> Callable[[int, int], FRONT]:
    """Return ours: from (seed, generations) to the last population's objectives."""
    search = loop.search()

    def run(seed: int, generations: int) -> FRONT:
        search.seed, search.generations = seed, generations
        return search(instant).F

    return run


def pymoo(loop: ClosedLoop, instant: Instant, *, compiled: bool) -> Callable[[int, int], FRONT]:
    """Return pymoo's loop with the paper's operators, evaluated in NumPy or by compiled code."""
    step = CompiledStep(loop, instant) if compiled else ControlStep(instant, loop.objectives)

    def run(seed: int, generations: int) -> FRONT:
        found = minimize(step, step.algorithm(loop.population), ("n_gen", generations + 1), seed=seed)
        return np.asarray(found.pop.get("F"))

    return run


def pygmo_nsga2(loop: ClosedLoop, instant: Instant) -> Callable[[int, int], FRONT]:
    """Return pygmo's NSGA-II, its operators, with the compiled evaluation of a whole population."""
    pygmo: Any = import_module("pygmo")  # here, so: optional
    step = CompiledStep(loop, instant)

    class Batched:
        def get_bounds(self) -> tuple[list[float], list[float]]:
            return step.xl.tolist(), step.xu.tolist()

        def get_nobj(self) -> int:
            return int(step.n_obj)

        def fitness(self, x: np.ndarray) -> np.ndarray:
            return self.batch_fitness(x)

        def batch_fitness(self, x: np.ndarray) -> np.ndarray:
            F = step.scored(x.reshape(-1, step.n_var))
            return np.where(np.isfinite(F), F, 1e30).ravel()

    def run(seed: int, generations: int) -> FRONT:
        method = pygmo.nsga2(gen=generations, seed=seed + 1)
        method.set_bfe(pygmo.bfe())
        population = pygmo.population(pygmo.problem(Batched()), size=loop.population, b=pygmo.bfe(), seed=seed + 1)
        return np.asarray(pygmo.algorithm(method).evolve(population).get_f())

    return run


def seconds(run: Callable[[int, int], FRONT], generations: int, rounds: int) -> float:
    """Return the least processor seconds of a search, of some rounds, in this thread: nobody has work for others."""
    taken = []
    for seed in range(rounds):
        begun = time.thread_time()
        run(seed, generations)
        taken.append(time.thread_time() - begun)
    return min(taken)
