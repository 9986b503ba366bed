"""The problems, the budgets, and the results of a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Literal, TypeAlias

import numpy as np
from moocore import is_nondominated

import paretoik as pk
from paretoik.arrays import Genes, Objectives
from paretoik.search.endings import Progress
from paretoik.search.genes import seeded_population
from paretoik.search.maximin import survivors
from problems import panda, tringali_2020
from studies.benchmarks.planner.questions import tracking

Kind: TypeAlias = Literal["evaluations", "CPU time"]

POPULATION = 100  # and the most points of a front
VIOLATION, OFF_PATH = 1e-8, 1e-6  # of a limit's range; m or rad: worse points count as absent


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem and its equal evaluations, and whether FATROP takes part."""

    name: str
    make: Callable[[], pk.Tracking]
    staged: bool = False
    evaluations: int = 4000


SAME = "simulations 2 and 3 with both objectives are energy_torque, simulation 5 is the cyclic circle: each runs once"
CASES = {
    case.name: case
    for case in (
        Case(name="energy_torque", make=tringali_2020.energy_torque, staged=True),
        Case(name="simulation 1", make=partial(tracking, "simulation_1", both=True), staged=True),
        Case(name="simulation 4", make=partial(tracking, "simulation_4", both=True), staged=True),
        Case(name="simulation 5 (cyclic)", make=partial(tracking, "simulation_5", both=True)),
        Case(name="Panda", make=panda.across_the_table, evaluations=1500),
    )
}


@lru_cache(maxsize=8)
def problem_of(case: str) -> pk.Tracking:
    """Return a case's problem, built once per process."""
    return CASES[case].make()


@dataclass(frozen=True, kw_only=True)
class Budget:
    """A number of evaluations (an iteration with derivatives counts as one), or of CPU seconds."""

    kind: Kind
    amount: float


@dataclass(kw_only=True)
class Account:
    """The part of its budget that a run has spent since it began."""

    budget: Budget
    evaluations: int = 0
    iterations: int = 0
    began: float = field(default_factory=time.process_time)

    @property
    def seconds(self) -> float:
        """CPU seconds so far, of all threads."""
        return time.process_time() - self.began

    @property
    def spent(self) -> float:
        """The amount spent, in the budget's unit."""
        return self.seconds if self.budget.kind == "CPU time" else float(self.evaluations + self.iterations)

    @property
    def left(self) -> float:
        """The amount left; negative after an overdraft."""
        return self.budget.amount - self.spent


@dataclass(frozen=True, kw_only=True)
class Spent:
    """A termination before a generation that exceeds the budget, less what is held back."""

    account: Account
    iterations: Callable[[], int]
    held_back: Callable[[int], float]  # from the number of the front's points, in the budget's unit
    memory: int = 0

    def reached(self, progress: Progress) -> str | None:
        """Return "budget" once it is spent."""
        account = self.account
        account.evaluations, account.iterations = progress.evaluations, self.iterations()
        step = POPULATION if account.budget.kind == "evaluations" else account.spent / progress.generation
        return "budget" if account.left < step + self.held_back(len(progress.front)) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A run's verified front (points, n_obj), how many points failed the verifier, and what was spent."""

    F: Objectives
    failed: int
    evaluations: int
    iterations: int
    seconds: float


def first_genes(problem: pk.Tracking, seed: int, *, seeded: bool = True) -> Genes:
    """Return the first population of a seed, the same for every method that starts alike."""
    rng = np.random.default_rng([seed, POPULATION])
    if seeded:
        return seeded_population(problem, POPULATION, rng=rng)
    return rng.uniform(problem.xl, problem.xu, size=(POPULATION, problem.n_var))


def spread(F: Objectives) -> np.ndarray:
    """Return at most ``POPULATION`` rows of a front, spread by MaxiMin: every method hands these in."""
    if len(F) <= POPULATION:
        return np.arange(len(F))
    return survivors(F, np.zeros(len(F)), POPULATION).index


def verify(problem: pk.Tracking, q: np.ndarray, account: Account) -> Run:
    """Return the run of these motions (points, time, dof), evaluated again: neither F nor G is trusted."""
    F, failed = np.empty((0, problem.n_obj)), 0
    if len(q):
        task, motions = problem.task, problem.task.motion(q)
        off = motions.tracking_error.max(axis=-1)
        worst = task.violations(motions).max(axis=-1, initial=0.0)
        F = np.stack([o(motions) * o.sign for o in task.objectives], axis=1)
        good = (off <= OFF_PATH) & (worst <= VIOLATION) & np.isfinite(F).all(axis=1)
        F, failed = F[good], int((~good).sum())
        if len(F):
            F = F[is_nondominated(F, keep_weakly=False)]
            F = F[spread(F)]
    return Run(
        F=F, failed=failed, evaluations=account.evaluations, iterations=account.iterations, seconds=account.seconds
    )
