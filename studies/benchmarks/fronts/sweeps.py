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

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS as EPSILON
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.fronts.cases import CASES, Account, Budget, Run, first_genes, problem_of, verify
from studies.benchmarks.fronts.programs import JointProgram, compiled_program, joint_program
from studies.benchmarks.planner.compiling import COMPILER, compiled
from studies.benchmarks.planner.peers import Question, peer

OURS = "ε paretoik"
SOLVERS = {"ε FATROP": "fatrop", "ε IPOPT": "ipopt"}
ENERGY, TORQUE = "kinetic_energy", "torque_norm"
SETTINGS = {  # of the planner's peers, warm or not: those of its sweeps
    False: (("mu_init", 1e-2),),
    True: (("mu_init", 1e-4), ("bound_push", 1e-4), ("bound_frac", 1e-4)),
}
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


@dataclass(frozen=True)
class Form:
    """A peer's form, which any process can solve: questions to the planner's peers, or a program of our own."""

    questions: tuple[Question, ...] = ()  # energy, torque, energy with torque capped
    library: str = ""  # of the compiled program


def form_of(name: str, case: str, folder: Path | None) -> Form:
    """Return a peer's form, compiled into a folder if one is given and there is a compiler."""
    solver, problem = SOLVERS[name], CASES[case].tringali
    into = folder if COMPILER else None
    if problem:
        asked = Question(solver=solver, problem=problem, samples=len(problem_of(case).task.times), main=ENERGY)
        questions = (asked, replace(asked, main=TORQUE), replace(asked, capped=TORQUE))
        return Form(tuple(compiled(one, into)[0] for one in questions) if into else questions)
    return Form(
        library=compiled_program(problem_of(case).task, f"program_{list(CASES).index(case)}", into) if into else ""
    )


def epsilon_run(problem: pk.Tracking, seed: int, budget: Budget, form: Form | None) -> Run:
    """Return a run of ε-constraints, ours without a form; building and compiling solvers is not counted."""
    make = our_solver(problem) if form is None else their_solver(problem, form)
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


def their_solver(problem: pk.Tracking, form: Form) -> Callable[[np.ndarray], Solve]:
    """Return a function that makes a peer's solver for given ranges; the planner's peers need none."""
    if not form.questions:
        return _general(problem, form)
    *alone, capped = form.questions
    for question, setting in itertools.product(form.questions, SETTINGS.values()):
        peer(question, setting)

    def solve(q: np.ndarray, main: int, ceilings: np.ndarray, warm: bool) -> tuple[np.ndarray | None, int]:
        question = capped if np.isfinite(ceilings[1]) else alone[main]
        got = peer(question, SETTINGS[warm]).solve(q, cap=float(ceilings[1]))
        return (got.q if got.solved else None), got.iterations

    return lambda _: solve


def _general(problem: pk.Tracking, form: Form) -> Callable[[np.ndarray], Solve]:
    program = _program(problem, form)

    def make(ranges: np.ndarray) -> Solve:
        def solve(q: np.ndarray, main: int, ceilings: np.ndarray, warm: bool) -> tuple[np.ndarray | None, int]:
            return program.solve(q, main, ceilings, ranges, warm=warm)

        return solve

    return make


@lru_cache(maxsize=8)
def _program(problem: pk.Tracking, form: Form) -> JointProgram:
    return joint_program(problem.task, form.library)


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
    for share in shares(count - 1):
        ceilings = np.concatenate([[np.inf], ideal[1:] + share * (worst - ideal)[1:]])
        beyond = np.abs(sweep.F[:, 1:] - ceilings[1:]) / np.maximum(worst - ideal, 1e-12)[1:]
        for row in np.argsort(beyond.max(axis=1), kind="stable")[:NEAREST].tolist():
            if not sweep.tried(sweep.motions[row], 0, ceilings, warm=True):
                return
        if not sweep.tried(next(starts), 0, ceilings):
            return


def shares(axes: int) -> Iterator[np.ndarray]:
    """Return points of the unit cube that are evenly spread at any count: Halton's."""
    for number in itertools.count(1):
        yield np.array([_radical_inverse(number, base) for base in (2, 3, 5, 7)[:axes]])


def _radical_inverse(number: int, base: int) -> float:
    value, place = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        value, place = value + digit * place, place / base
    return value
