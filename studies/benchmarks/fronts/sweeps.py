"""Fronts by multi-start ε-constraints within a budget: by FATROP, by IPOPT, and by our own interior-point method.

Each objective is minimised alone from a few seeded motions first. Then the first objective is minimised below ceilings
on the others, evenly spread whenever the budget ends, each from the nearest motions found and from one more seeded one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.stats.qmc import Halton

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS as EPSILON
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.fronts.methods import CASES, Account, Budget, Run, first_genes, problem_of, verify
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import COLD, WARM, Peer, compiled

OURS, FATROP, IPOPT = "ε paretoik", "ε FATROP", "ε IPOPT"
ALONE = 3  # starts of each single objective
NEAREST = 2  # motions that a level starts from

# from a motion to an optimum of objective ``main``, others below ceilings: (motion or None, iterations)
Solve: TypeAlias = Callable[[np.ndarray, int, np.ndarray, bool], tuple[np.ndarray | None, int]]


@dataclass(eq=False)
class Sweep:
    """A solver, and every motion to which it converged."""

    solve: Solve
    account: Account
    problem: pk.Tracking
    motions: list[np.ndarray]
    F: np.ndarray

    def tried(self, q: np.ndarray, main: int, ceilings: np.ndarray | None = None, *, warm: bool = False) -> bool:
        """Solve from a motion and keep the result; return False if the budget ends before."""
        account, task = self.account, self.problem.task
        free = np.full(self.problem.n_obj, np.inf)
        made, iterations = self.solve(q, main, free if ceilings is None else ceilings, warm)
        account.iterations += iterations
        if account.left < 0:  # ended during the solve: thrown away
            account.iterations -= iterations if account.budget.kind == "evaluations" else 0
            return False
        if made is not None:
            motion = task.motion(made)
            self.motions.append(made)
            self.F = np.concatenate([self.F, [[float(o(motion)) * o.sign for o in task.objectives]]])
        return True


@lru_cache(maxsize=32)
def peer_of(name: str, case: str, library: str = "") -> Peer:
    """Return a peer's program of a case, compiled if there is a library; built once per process."""
    task = problem_of(case).task
    program = staged_program(task, capped=range(1, len(task.objectives))) if name == FATROP else joint_program(task)
    return replace(program, library=library)


def library_of(name: str, case: str, folder: Path | None) -> str:
    """Return the compiled program of a peer, "" without a folder or a compiler."""
    return compiled(peer_of(name, case), f"{name.split()[1]}_{list(CASES).index(case)}", folder).library


def epsilon_run(problem: pk.Tracking, seed: int, budget: Budget, peer: Peer | None) -> Run:
    """Return a run of ε-constraints, ours without a peer; building and compiling solvers is not counted."""
    make = our_solver(problem) if peer is None else their_solver(peer)
    account = Account(budget=budget)
    task, starts = problem.task, problem.decode(first_genes(problem, seed)).q
    excess = np.maximum(task.violations(task.motion(starts)), 0.0).sum(axis=1)
    order = np.random.default_rng(seed).permutation(len(starts))
    order = order[np.argsort(excess[order], kind="stable")]
    values = np.stack([o(task.motion(starts[order[:20]])) * o.sign for o in task.objectives], axis=1)
    solve = make(np.maximum(np.abs(np.median(values, axis=0)), 1e-9))
    sweep = Sweep(solve, account, problem, [], np.empty((0, problem.n_obj)))
    _sweep(sweep, itertools.cycle(starts[order]))
    return verify(problem, np.array(sweep.motions).reshape(-1, *starts.shape[1:]), account)


def our_solver(problem: pk.Tracking) -> Callable[[np.ndarray], Solve]:
    """Return a function that makes our solver for given ranges of the objectives."""
    task, count = problem.task, problem.n_obj
    motion_program(task)  # differentiated and compiled once

    def make(ranges: np.ndarray) -> Solve:
        program = motion_program(task, ranges)

        def solve(q: np.ndarray, main: int, ceilings: np.ndarray, warm: bool) -> tuple[np.ndarray | None, int]:
            factors, below = np.zeros((1, len(program.totals))), np.full((1, len(program.totals)), np.inf)
            factors[0, :count] = EPSILON.end_tolerance
            factors[0, main] = 1.0
            below[0, :count] = ceilings / ranges
            got = minimise(program, q[None], factors, below, EPSILON.warm if warm else EPSILON.cold)
            return (got.x[0] if got.converged[0] else None), int(got.iterations[0])

        return solve

    return make


def their_solver(peer: Peer) -> Callable[[np.ndarray], Solve]:
    """Return a function that makes a peer's solver for given ranges of the objectives."""
    for settings in (COLD, WARM):
        peer.build(settings)

    def make(ranges: np.ndarray) -> Solve:
        def solve(q: np.ndarray, main: int, ceilings: np.ndarray, warm: bool) -> tuple[np.ndarray | None, int]:
            got = peer.solve(q, main, ceilings, ranges, WARM if warm else COLD)
            return got.motion, got.iterations

        return solve

    return make


def _sweep(sweep: Sweep, starts: Iterator[np.ndarray]) -> None:
    count = sweep.problem.n_obj
    for _ in range(ALONE):
        for main in range(count):
            if not sweep.tried(next(starts), main):
                return
    while len(sweep.F) < 2:
        if not sweep.tried(next(starts), 0):
            return
    ideal = sweep.F.min(axis=0)
    worst = sweep.F[sweep.F.argmin(axis=0)].max(axis=0)  # of the best of each objective
    halton = Halton(count - 1, scramble=False)  # evenly spread at any count
    halton.fast_forward(1)  # the first is 0
    while True:
        share = halton.random(1)[0]
        ceilings = np.concatenate([[np.inf], ideal[1:] + share * (worst - ideal)[1:]])
        beyond = np.abs(sweep.F[:, 1:] - ceilings[1:]) / np.maximum(worst - ideal, 1e-12)[1:]
        for row in np.argsort(beyond.max(axis=1), kind="stable")[:NEAREST].tolist():
            if not sweep.tried(sweep.motions[row], 0, ceilings, warm=True):
                return
        if not sweep.tried(next(starts), 0, ceilings):
            return
