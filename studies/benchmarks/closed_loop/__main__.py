"""A control step's search and its peers: ``python -m studies.benchmarks.closed_loop [--quick] [--json FILE]``.

Processor time per generation, kinematics included: ours, pymoo with the same operators, and pygmo's NSGA-II (its own
operators) with our compiled evaluation of whole populations, on one step, one after the other. Rows have medians over
rounds: of the times, and of the ratios within a round. Further rows: the time of an exact step, and whether our fronts
equal pymoo's.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
from typing import Any

import numpy as np
from moocore import is_nondominated
from pymoo.optimize import minimize
from scipy.stats import mannwhitneyu

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.closed_loop.step_search_kernels import decode
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.front.hypervolume import hypervolume
from problems import marcos_2012
from problems.marcos_2012 import Links
from studies.marcos_2012.exact_loop import OPTIONS, exact_steps
from studies.reporting import Row, goal_row, report, study_parser

GENERATIONS = 200
PYGMO = find_spec("pygmo") is not None
FRONT = np.ndarray


def loop_of(links: Links, *, blocked: bool = False, as_printed: bool = True) -> ClosedLoop:
    """Return the paper's loop, without or with obstacles, from a start on the circle.

    Steps are of any length if ``as_printed``; otherwise they are bounded and clear of obstacles all the way.
    """
    loop = marcos_2012.loop(links, 0.7, start=None, steps=400, as_printed=True)
    # Joint positions with the tool at the circle's beginning, by Newton's method from a bent arm
    q = np.linspace(0.3, 1.0, loop.task.arm.dof)
    for _ in range(50):
        error, jacobian = loop.changed(start=q).step_state(1).linearise()
        error -= loop.task.targets[1] - loop.task.targets[0]
        q = q + np.linalg.pinv(jacobian) @ error
    return marcos_2012.loop(links, 0.7, start=q, steps=400, as_printed=as_printed, blocked=blocked)


class CompiledStep:
    """A step without obstacles and bounds, its genes evaluated by the engine's compiled code, all at once."""

    def __init__(self, loop: ClosedLoop, step: StepState) -> None:
        self.readable = loop.control_step(step.sample, step.history)
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


def engine(loop: ClosedLoop, step: StepState) -> Callable[[int, int], FRONT]:
    """Return our search: from (seed, generations) to the last population's objectives."""
    search = loop.step_evolution()

    def run(seed: int, generations: int) -> FRONT:
        search.seed, search.generations = seed, generations
        return search(step).F

    return run


def pymoo(loop: ClosedLoop, step: StepState) -> Callable[[int, int], FRONT]:
    """Return pymoo's loop with the paper's operators, evaluated in NumPy."""
    problem = loop.control_step(step.sample, step.history)

    def run(seed: int, generations: int) -> FRONT:
        result = minimize(problem, problem.algorithm(loop.population), ("n_gen", generations + 1), seed=seed)
        return np.asarray(result.pop.get("F"))

    return run


def pygmo_nsga2(loop: ClosedLoop, step: StepState) -> Callable[[int, int], FRONT]:
    """Return pygmo's NSGA-II, its operators, with the compiled evaluation of a whole population."""
    pygmo: Any = import_module("pygmo")  # here, so: optional
    problem = CompiledStep(loop, step)

    class BatchProblem:
        def get_bounds(self) -> tuple[list[float], list[float]]:
            return problem.readable.xl.tolist(), problem.readable.xu.tolist()

        def get_nobj(self) -> int:
            return int(problem.readable.n_obj)

        def fitness(self, x: np.ndarray) -> np.ndarray:
            return self.batch_fitness(x)

        def batch_fitness(self, x: np.ndarray) -> np.ndarray:
            F = problem.score_genes(x.reshape(-1, problem.readable.n_var))
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
            note = f"{'equal' if p < LEVEL else 'UNDECIDED'} within {MARGIN:.0%}: p {p:.1e}; ranges "
            note += f"{np.ptp(ours):.1e}, {np.ptp(theirs):.1e}"
            title = f"the engine's fronts beside pymoo's, {GENERATIONS} generations, {seeds} seeds"
            place = title, f"{links}R, step {sample}"
            column, peer = "median hypervolume, share of the exact front's", float(np.median(theirs))
            rows.append(Row(*place, column, "", float(np.median(ours)), reference=peer, source="pymoo", note=note))
    return rows


def search_front(links: Links, sample: int, name: str, seed: int) -> np.ndarray:
    """Return the objectives of one run's last population."""
    loop = loop_of(links, as_printed=False)
    step = control_step(loop, sample)
    run = engine(loop, step) if name == "engine" else pymoo(loop, step)
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


ARMS: tuple[Links, ...] = (3, 4)
EXACT, GOAL_EXACT = 100, 1e-4  # samples of a loop, and seconds a step
GOALS = {"pymoo": 300.0, "pygmo's NSGA-II": 50.0}


def speed_rows(links: Links, rounds: int, slow_generations: int) -> list[Row]:
    """Return microseconds per generation of all methods on the first step of an arm, each compared with ours."""
    loop = loop_of(links)
    step = loop.step_state(1)
    contestants: dict[str, tuple[Callable[[int, int], np.ndarray], int, int]] = {  # generations, searches a round
        "ours": (engine(loop, step), GENERATIONS, 10),
        "pymoo": (pymoo(loop, step), slow_generations, 1),
    }
    if PYGMO:
        contestants["pygmo's NSGA-II"] = pygmo_nsga2(loop, step), GENERATIONS, 1
    for run, *_ in contestants.values():
        run(0, 2)
    taken = np.array([[seconds(*each, seed) for each in contestants.values()] for seed in range(rounds)])
    rows = []
    for name, each in zip(contestants, taken.T, strict=True):
        ratios, goal = each / taken[:, 0], GOALS.get(name)
        ratio = float(np.median(ratios))
        prefix = "LOSS: " if goal is not None and ratio < goal else ""
        times = f"{prefix}{ratio:.0f} times ours" + (f", goal {goal:.0f}" if goal else "")
        note = "" if name == "ours" else f"{times}; in rounds {ratios.min():.0f} to {ratios.max():.0f}"
        row = f"{links}R, population {loop.population}"
        rows.append(Row("a generation, processor time", row, name, "µs", 1e6 * float(np.median(each)), note=note))
    return rows


def exact_rows(rounds: int) -> list[Row]:
    """Return the time of an exact step, without obstacles and with the paper's two, over the first steps of a loop."""
    rows = []
    for links in ARMS:
        for blocked in (False, True):
            loop = loop_of(links, blocked=blocked)
            follow = partial(exact_steps, loop.task.truncate(EXACT), loop.start, weight=0.5)
            follow()
            seconds_taken = []
            for _ in range(rounds):
                started = time.thread_time()
                follow()
                seconds_taken.append((time.thread_time() - started) / (EXACT - 1))
            column, seconds = "with two obstacles" if blocked else "no obstacles", 1e6 * min(seconds_taken)
            place = "an exact step, processor time", f"{links}R", column, "µs"
            has_goal = links == 3 and not blocked
            rows.append(goal_row(*place, seconds, 1e6 * GOAL_EXACT) if has_goal else Row(*place, seconds))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    options = study_parser(__doc__, quick="3 rounds, 5 seeds on one step").parse_args(arguments)
    if not PYGMO:
        print("left out: pygmo, which is not installed")
    rounds, slow = (3, 20) if options.quick else (9, 60)
    rows = [row for links in ARMS for row in speed_rows(links, rounds, slow)]
    rows += exact_rows(rounds)
    rows += equivalence_rows(5, STEPS[:1]) if options.quick else equivalence_rows(31)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
