"""Problems, budgets, and methods that make a front by evolution: cells of the factorial, ours, pymoo's, pygmo's.

All of pymoo runs in our own loop, from the same first genes, with our archive: only selection and mating differ. A
refined run holds back what refining its points will take, at most 30 % of its budget; iterations count.
"""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, Literal, TypeAlias

import numpy as np
from moocore import is_nondominated
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

import paretoik as pk
from paretoik.arrays import Genes, Objectives
from paretoik.formulations.tracking import OPTIONS as TRACKING
from paretoik.nlp.minimise import minimise
from paretoik.pareto.refine import OPTIONS as REFINE
from paretoik.pareto.refine import SearchImprover
from paretoik.search.archive import Archive
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Progress
from paretoik.search.evolution import evolve
from paretoik.search.genes import seeded_population
from paretoik.search.maximin import survivors
from paretoik.search.nsga2 import BranchwiseMating, MaxiMinNSGA2
from paretoik.search.objectives import violations
from paretoik.search.operators import Differential, SmoothMutation
from paretoik.trajectory.transcription import motion_program
from problems import panda, tringali_2020
from studies.benchmarks.maximin import pymoo_algorithm
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


OURS = "paretoik"
HELD_BACK = 0.3  # most of a refined run's budget that is kept for refining at its end
PER_POINT = 20  # iterations expected for a point
DEARER = 2.0  # cost of an iteration in evaluations, until one was measured
AT_ONCE = 10  # points refined in one batch
PENALTY = 10.0  # medians of an objective for a violation of a whole range
FACTORS = ("MaxiMin", "seeding", "refinement")


@dataclass(frozen=True)
class Cell:
    """One of the eight: MaxiMin or crowding, seeded or random, refined or not."""

    maximin: bool
    seeded: bool
    refined: bool

    @property
    def name(self) -> str:
        """Name in tables."""
        selection, start = ("crowding", "MaxiMin")[self.maximin], ("random", "seeded")[self.seeded]
        return f"{selection}, {start}, {('plain', 'refined')[self.refined]}"


CELLS = {cell.name: cell for cell in (Cell(*levels) for levels in itertools.product((False, True), repeat=3))}


class Crowding(RankAndCrowding):  # type: ignore[misc]  # pymoo has no types
    """pymoo's own, which also gives infeasible points the rank and the distance that our mating uses."""

    def do(self, problem: Any, pop: Any, *args: Any, **options: Any) -> Any:
        """Return the survivors."""
        survivors = super().do(problem, pop, *args, **options)
        for individual in survivors:
            if individual.CV[0] > 0.0:
                individual.data["rank"], individual.data["crowding"] = len(pop), 0.0
        return survivors


def ours(problem: pk.Tracking, seed: int, budget: Budget, generations: int) -> Run:
    """Return a run of ``pk.solve(refine=True)`` at its defaults, with this population and budget."""
    account = Account(budget=budget)
    anchors = generations // (2 * problem.n_obj)
    search = Search(problem, population=POPULATION, seed=seed, initial=first_genes(problem, seed), anchors=anchors)
    return _search(search, account, refine=True)


def cell_run(cell: Cell, problem: pk.Tracking, seed: int, budget: Budget) -> Run:
    """Return a run of one cell of the factorial: both selections have the same operators and the same parents."""
    account = Account(budget=budget)
    first = first_genes(problem, seed, seeded=cell.seeded)
    crossover, mutation = Differential(), SmoothMutation(problem.encoding.coefficients)
    algorithm: Any
    if cell.maximin:
        algorithm = MaxiMinNSGA2(
            len(first),
            sampling=first,
            crossover=crossover,
            mutation=mutation,
            infeasible_share=TRACKING.infeasible_share,
        )
    else:
        mating = BranchwiseMating(crossover, mutation, infeasible_parents=True)
        algorithm = NSGA2(pop_size=len(first), sampling=first, survival=Crowding(), mating=mating)
    search = Search(problem, seed=seed, algorithm=algorithm)
    return _search(search, account, refine=cell.refined)


def pymoo_run(name: str, problem: pk.Tracking, seed: int, budget: Budget) -> Run:
    """Return a run of one of pymoo's algorithms."""
    account, first = Account(budget=budget), first_genes(problem, seed)
    search = Search(problem, seed=seed, algorithm=pymoo_algorithm(name, problem.n_obj, first))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own warnings about divisions
        return _search(search, account, refine=False)


class Refining:
    """Our improver, and its cost so far."""

    def __init__(self, search: Search, account: Account) -> None:
        self.improver, self.account, self.seconds = SearchImprover(search, search.problem), account, 0.0

    def __call__(self, progress: Progress) -> Genes | None:
        """Return genes to be evaluated next, or None."""
        before = self.account.seconds
        genes = self.improver(progress)
        self.seconds += self.account.seconds - before
        return genes

    def held_back(self, points: int) -> float:
        """Return the expected cost of refining a number of points, in the budget's unit."""
        budget, iterations = self.account.budget, float(PER_POINT * min(points, POPULATION))
        if budget.kind == "CPU time":
            known = self.improver.spent > 0
            taken, of = (
                (self.seconds, self.improver.spent) if known else (self.account.seconds, self.account.evaluations)
            )
            iterations *= taken / of if known else DEARER * taken / of
        return min(iterations, HELD_BACK * budget.amount) if points else 0.0


def _search(search: Search, account: Account, *, refine: bool) -> Run:
    refining = Refining(search, account) if refine else None
    if refining is None:
        evolve(search, [Spent(account=account, iterations=lambda: 0, held_back=lambda _: 0.0)])
    else:
        spent = Spent(account=account, iterations=lambda: refining.improver.spent, held_back=refining.held_back)
        evolve(search, [spent], improve=refining)
    members = search.archive.members
    if members is None or not len(members):
        return verify(search.problem, np.empty((0, 0, 0)), account)
    members = members[spread(members.F)]
    q = search.problem.decode(members.X).q
    if refine:
        # The first motions are refined as ``pk.refine`` does while the budget lasts. Results beyond it are thrown away:
        # of counted iterations the points past it, of seconds the whole batch.
        F = members.F
        task, count = search.problem.task, search.problem.n_obj
        wide = np.ptp(F, axis=0)
        ranges = np.where(wide > 0, wide, np.maximum(np.abs(F).max(axis=0), 1.0))
        program = motion_program(task, ranges)
        factors = np.zeros((1, len(program.totals)))
        factors[0, :count] = [1.0, *[REFINE.weight] * (count - 1)]
        caps = np.full((len(q), len(program.totals)), np.inf)
        caps[:, 1:count] = F[:, 1:] / ranges[1:]
        made, counted = q.copy(), account.budget.kind == "evaluations"
        for rows in np.array_split(np.arange(len(q)), -(-len(q) // AT_ONCE)):
            before, remaining = account.spent, account.left
            solutions = minimise(program, q[rows], factors, caps[rows], REFINE.below)
            total = np.cumsum(solutions.iterations)
            paid = total <= remaining if counted else np.full(len(rows), account.left >= 0)
            account.iterations += int(solutions.iterations[paid].sum()) if counted else int(total[-1])
            good = solutions.converged & paid
            made[rows[good]] = solutions.x[good]
            if not paid.all() or (not counted and account.left < account.spent - before):  # the next would not fit
                break
        q = made
    return verify(search.problem, q, account)


class RecordingProblem:
    """A problem for pygmo: constraints as a penalty, and an archive of all evaluated points."""

    def __init__(self, problem: pk.Tracking, account: Account) -> None:
        self.problem, self.account = problem, account
        self.archive = Archive()
        self.scale = np.ones(problem.n_obj)

    def __deepcopy__(self, memo: object) -> RecordingProblem:
        """Return itself: pygmo copies its problems, but the archive must stay one."""
        return self

    def get_nobj(self) -> int:
        """Return the number of objectives."""
        return int(self.problem.n_obj)

    def get_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of the genes."""
        return self.problem.xl, self.problem.xu

    def fitness(self, x: np.ndarray) -> np.ndarray:
        """Return the penalised objectives of one individual."""
        return self.batch_fitness(x)

    def batch_fitness(self, every: np.ndarray) -> np.ndarray:
        """Return the objectives of many individuals, one after the other, as pygmo passes them."""
        X = every.reshape(-1, self.problem.n_var)
        values = self.problem.evaluate(X, return_as_dictionary=True)
        F, G = np.asarray(values["F"], dtype=float), np.asarray(values["G"], dtype=float)
        ids = np.arange(self.account.evaluations, self.account.evaluations + len(X))
        self.archive.add(ids, X.copy(), F, G, 0)
        self.account.evaluations += len(X)
        if ids[0] == 0:
            self.scale = np.median(np.abs(F[np.isfinite(F).all(axis=1)]), axis=0)
        excess = np.minimum(violations(F, G), 1e6)[:, None]
        usable = np.where(np.isfinite(F), F, 1e6 * self.scale)
        return np.asarray(usable + PENALTY * self.scale * excess).ravel()


def pygmo_run(name: str, problem: pk.Tracking, seed: int, budget: Budget) -> Run:
    """Return a run of one of pygmo's algorithms, whole generations in batches."""
    pygmo: Any = importlib.import_module("pygmo")  # imported here: optional

    account = Account(budget=budget)
    recorded = RecordingProblem(problem, account)
    asked = pygmo.problem(recorded)
    first = first_genes(problem, seed)
    population = pygmo.population(asked, size=0, seed=seed)
    for x, f in zip(first, recorded.batch_fitness(first.ravel()).reshape(len(first), -1), strict=True):
        population.push_back(x, f)
    if name == "pygmo NSGA-II":
        method = pygmo.nsga2(gen=1, seed=seed)
    else:
        neighbours = min(20, len(first) - 1)
        method = pygmo.moead_gen(gen=1, seed=seed, weight_generation="low discrepancy", neighbours=neighbours)
    method.set_bfe(pygmo.bfe(pygmo.member_bfe()))
    algorithm = pygmo.algorithm(method)
    step = 0.0
    while account.left >= (POPULATION if budget.kind == "evaluations" else step):
        before = account.spent
        population = algorithm.evolve(population)
        step = account.spent - before
    members = recorded.archive.members
    if members is None or not len(members):
        return verify(problem, np.empty((0, 0, 0)), account)
    return verify(problem, problem.decode(members.X[spread(members.F)]).q, account)


PYMOO = ("NSGA-II", "NSGA-III", "SMS-EMOA")
PYGMO = ("pygmo NSGA-II", "pygmo MOEA/D") if importlib.util.find_spec("pygmo") else ()
