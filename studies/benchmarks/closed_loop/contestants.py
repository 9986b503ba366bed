"""A control step's search by the engine, by pymoo, by pymoo with a compiled evaluation, and by pygmo."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
from typing import Any

import numpy as np
from moocore import is_nondominated
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from scipy.stats import mannwhitneyu

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.closed_loop.engine import decode
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.front.hypervolume import hypervolume
from problems import marcos_2012
from problems.marcos_2012 import Links
from studies.marcos_2012.exact_loop import OPTIONS, exact_steps
from studies.reporting import Row

GENERATIONS = 200
PYGMO = find_spec("pygmo") is not None
FRONT = np.ndarray


def loop_of(links: Links, *, blocked: bool = False, as_printed: bool = True) -> ClosedLoop:
    """Return the paper's loop, without or with obstacles, from a start on the circle.

    Steps are of any length if ``as_printed``; otherwise they are bounded and clear of obstacles all the way.
    """
    loop = marcos_2012.loop(links, 0.7, start=None, steps=400, as_printed=True)
    start = start_on_circle(loop)
    return marcos_2012.loop(links, 0.7, start=start, steps=400, as_printed=as_printed, blocked=blocked)


def start_on_circle(loop: ClosedLoop) -> np.ndarray:
    """Return joint positions with the tool at the circle's beginning, by Newton's method from a bent arm."""
    q = np.linspace(0.3, 1.0, loop.task.arm.dof)
    for _ in range(50):
        error, jacobian = loop.changed(start=q).step_state(1).linearise()
        error -= loop.task.targets[1] - loop.task.targets[0]
        q = q + np.linalg.pinv(jacobian) @ error
    return q


class CompiledStepProblem(Problem):  # type: ignore[misc]  # pymoo is not typed
    """A step without obstacles and bounds, its genes evaluated by the engine's compiled code, all at once."""

    def __init__(self, loop: ClosedLoop, step: StepState) -> None:
        readable = loop.control_step(step.sample, step.history)
        super().__init__(n_var=readable.n_var, n_obj=readable.n_obj, xl=readable.xl, xu=readable.xu)
        self.algorithm = readable.algorithm
        self.search = loop.step_evolution()
        self.search(step)  # its workspace now has the inputs that all candidates share
        self.start, _ = self.search.start_and_constraints(step)

    def score_genes(self, X: np.ndarray) -> np.ndarray:
        """Return the objectives of genes."""
        w, n = self.search.workspace, len(self.start.previous)
        w.children[:, : len(X)] = X.T
        decode(w.children, len(X), self.start, w.linear_systems, w.inputs)
        for j in range(n):
            w.inputs[n + j, : len(X)] = (w.inputs[j, : len(X)] - self.start.previous[j]) / self.start.dt
        run_first(self.search.programs.objectives.arrays, w.inputs, w.outputs, len(X))
        F: np.ndarray = w.outputs[:, : len(X)].T.copy()
        return np.where(np.isfinite(F).all(axis=1)[:, None], F, np.inf)

    def redraw(self, genes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return genes as they are: all are admissible."""
        return genes

    def _evaluate(self, X: np.ndarray, out: dict[str, object], *args: object, **kwargs: object) -> None:
        out["F"] = self.score_genes(X)


def engine(loop: ClosedLoop, step: StepState) -> Callable[[int, int], FRONT]:
    """Return our search: from (seed, generations) to the last population's objectives."""
    search = loop.step_evolution()

    def run(seed: int, generations: int) -> FRONT:
        search.seed, search.generations = seed, generations
        return search(step).F

    return run


def pymoo(loop: ClosedLoop, step: StepState, *, compiled: bool) -> Callable[[int, int], FRONT]:
    """Return pymoo's loop with the paper's operators, evaluated in NumPy or by compiled code."""
    problem = CompiledStepProblem(loop, step) if compiled else loop.control_step(step.sample, step.history)

    def run(seed: int, generations: int) -> FRONT:
        result = minimize(problem, problem.algorithm(loop.population), ("n_gen", generations + 1), seed=seed)
        return np.asarray(result.pop.get("F"))

    return run


def pygmo_nsga2(loop: ClosedLoop, step: StepState) -> Callable[[int, int], FRONT]:
    """Return pygmo's NSGA-II, its operators, with the compiled evaluation of a whole population."""
    pygmo: Any = import_module("pygmo")  # here, so: optional
    problem = CompiledStepProblem(loop, step)

    class BatchProblem:
        def get_bounds(self) -> tuple[list[float], list[float]]:
            return problem.xl.tolist(), problem.xu.tolist()

        def get_nobj(self) -> int:
            return int(problem.n_obj)

        def fitness(self, x: np.ndarray) -> np.ndarray:
            return self.batch_fitness(x)

        def batch_fitness(self, x: np.ndarray) -> np.ndarray:
            F = problem.score_genes(x.reshape(-1, problem.n_var))
            return np.where(np.isfinite(F), F, 1e30).ravel()

    def run(seed: int, generations: int) -> FRONT:
        method = pygmo.nsga2(gen=generations, seed=seed + 1)
        method.set_bfe(pygmo.bfe())
        population = pygmo.population(pygmo.problem(BatchProblem()), size=loop.population, b=pygmo.bfe(), seed=seed + 1)
        return np.asarray(pygmo.algorithm(method).evolve(population).get_f())

    return run


def seconds(run: Callable[[int, int], FRONT], generations: int, searches: int, turn: int) -> float:
    """Return the processor seconds per generation of this thread: no method uses others.

    The searches of a ``turn`` have seeds of their own.
    """
    begun = time.thread_time()
    for seed in range(turn * searches, (turn + 1) * searches):
        run(seed, generations)
    return (time.thread_time() - begun) / (generations * searches)


MARGIN, LEVEL = 0.01, 0.05
STEPS: tuple[tuple[Links, int], ...] = ((3, 1), (3, 60), (3, 240), (4, 60))
REFERENCE = 1.1
DENSE = 200_001


def equivalence_rows(seeds: int, steps: Sequence[tuple[Links, int]] = STEPS) -> list[Row]:
    """Return, for each step, both medians, the larger p of the two tests and the verdict."""
    rows = []
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for links, sample in steps:
            fronts = {
                name: list(pool.map(search_front, [links] * seeds, [sample] * seeds, [name] * seeds, range(seeds)))
                for name in ("engine", "pymoo")
            }
            loop = loop_of(links, as_printed=False)
            ours, theirs = volumes(fronts["engine"], fronts["pymoo"], exact_front(loop, control_step(loop, sample)))
            p = max(
                mannwhitneyu(ours + MARGIN, theirs, alternative="greater").pvalue,
                mannwhitneyu(ours - MARGIN, theirs, alternative="less").pvalue,
            )
            verdict = "equal" if p < LEVEL else "UNDECIDED"
            rows.append(
                Row(
                    f"the engine's fronts beside pymoo's, {GENERATIONS} generations, {seeds} seeds",
                    f"{links}R, step {sample}",
                    "median hypervolume, share of the exact front's",
                    "",
                    float(np.median(ours)),
                    reference=float(np.median(theirs)),
                    source="pymoo",
                    note=f"{verdict} within {MARGIN:.0%}: p {p:.1e}; ranges {np.ptp(ours):.1e}, {np.ptp(theirs):.1e}",
                )
            )
    return rows


def search_front(links: Links, sample: int, name: str, seed: int) -> np.ndarray:
    """Return the objectives of one run's last population."""
    loop = loop_of(links, as_printed=False)
    step = control_step(loop, sample)
    run = engine(loop, step) if name == "engine" else pymoo(loop, step, compiled=False)
    return run(seed, GENERATIONS)


def volumes(
    ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray], exact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the hypervolumes of all fronts as shares of the exact one's, in the box of all non-dominated points."""
    union = np.concatenate([*ours, *theirs])
    union = union[is_nondominated(union)]
    low, width = np.minimum(union.min(axis=0), exact.min(axis=0)), np.ptp(union, axis=0)
    whole = _volume(exact, low, width)
    shares = [np.array([_volume(F, low, width) / whole for F in side]) for side in (ours, theirs)]
    return shares[0], shares[1]


def exact_front(loop: ClosedLoop, step: StepState) -> np.ndarray:
    """Return a fine front of the admissible steps: along a line for three links, over a plane for four.

    The plane's grid is fine: its front's hypervolume lacks less than 1 %. Searches can come out above it.
    """
    error, jacobian = step.linearise()
    null = np.linalg.svd(jacobian)[2][len(error) :].T
    shortest = np.linalg.pinv(jacobian) @ error
    center = -0.5 * null.T @ (step.previous + shortest - step.home)
    if null.shape[1] == 1:
        y = np.sinh(np.linspace(-18, 18, DENSE))[:, None] * OPTIONS.farthest / np.sinh(18)
    else:
        radius, angle = np.meshgrid(np.geomspace(1e-7, 1.0, 700), np.linspace(0, 2 * np.pi, 360, endpoint=False))
        y = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
        y = np.concatenate([np.zeros((1, 2)), y])
    q = step.previous + shortest + (center + y) @ null.T
    steps = step.steps(q[step.is_admissible(q)])
    F = np.stack([each.function(steps)[..., -1] * each.sign for each in loop.objectives], axis=1)
    front: np.ndarray = F[is_nondominated(F)]
    return front


def control_step(loop: ClosedLoop, sample: int) -> StepState:
    """Return a step of the exact loop."""
    q = loop.start[None]
    if sample > 1:
        q = exact_steps(loop.task.truncate(sample), loop.start, weight=0.5, longest_step=loop.longest)
    return loop.step_state(sample, np.concatenate([np.tile(q[:1], (HISTORY, 1)), q])[-HISTORY:])


def _volume(F: np.ndarray, low: np.ndarray, width: np.ndarray) -> float:
    return float(hypervolume((F - low) / width, np.full(2, REFERENCE)))
