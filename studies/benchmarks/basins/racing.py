"""One problem: our plan over seeds, and peers from many starts in the same processor time."""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection

import numpy as np

import paretoik as pk
from paretoik.errors import ParetoikError
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import rollout_starts
from paretoik.trajectory.plan_starts import sample_starts
from studies.benchmarks.basins.cases import Case, all_cases
from studies.benchmarks.certified.attacks import led_back, objectives, violation
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import Peer
from studies.reporting import LOSS, Row, losses_first, versus


@dataclass(frozen=True, kw_only=True)
class RacingOptions:
    """How tries are judged, and how many of a peer's ``starts`` are made at a time.

    A value counts as the best up to a share ``equal`` of it. A peer's motion counts as feasible up to a ``violation``,
    a share of a limit's range. A problem takes minutes, at most ``limit`` [s]; with a limit a cluster's workers compute
    in a separate process.
    """

    equal: float = 1e-6
    violation: float = 1e-8
    starts: int = 24
    limit: float = 4 * 3600.0


OPTIONS = RacingOptions()


@dataclass(kw_only=True)
class Tries:
    """Values that a method found, and the processor seconds of each try."""

    values: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    @property
    def best(self) -> float:
        """The best value; infinite without one."""
        return min(self.values, default=np.inf)

    def hits(self, best: float) -> int:
        """Return the number of tries that ended at the best."""
        return sum(value <= best * (1 + OPTIONS.equal) for value in self.values)

    def time_to_best(self, best: float) -> float:
        """Return the expected processor time of independent tries to the best."""
        hits = self.hits(best)
        return sum(self.seconds) / hits if hits else np.inf


@dataclass(frozen=True, kw_only=True)
class Race:
    """The result for a problem: our tries, and those of every peer."""

    case: Case
    redundancy: int
    ours: Tries
    peers: dict[str, Tries]

    @property
    def peers_best(self) -> float:
        """The best value of all peers."""
        return min(tries.best for tries in self.peers.values())

    @property
    def best(self) -> float:
        """The best value of all methods."""
        return min(self.ours.best, self.peers_best)

    @property
    def time_ratio(self) -> float:
        """Our time to the best over the better peer's; 0 without a peer, infinite if we did not find it."""
        theirs = min(tries.time_to_best(self.best) for tries in self.peers.values())
        ours = self.ours.time_to_best(self.best)
        return ours / theirs if np.isfinite(ours) else np.inf

    @property
    def summary(self) -> str:
        """One line: values, hits of each, and time."""
        sides = {"ours": self.ours, **self.peers}
        hits = ", ".join(f"{name} {tries.hits(self.best)}/{len(tries.values)}" for name, tries in sides.items())
        return (
            f"{self.case.name}: redundancy {self.redundancy}, best {self.ours.best:.8g} beside {self.peers_best:.8g} "
            f"({self.ours.best / self.best - 1:.1e} worse), {hits}, {sum(self.ours.seconds):.1f} s, "
            f"time ratio {self.time_ratio:.2g}"
        )


def race_named(name: str, *, seed: int, seeds: int) -> Race:
    """Return the race of the problem with a name: by name so that it can run in another process."""
    return race(next(case for case in all_cases(seed) if case.name == name), seeds=seeds)


def race(case: Case, *, seeds: int) -> Race:
    """Return the race of one problem. FATROP's form has neither peaks nor cycles."""
    problem = case.problem()
    pk.plan(problem, starts=1)  # compiles
    ours = our_tries(problem, seeds)
    budget = sum(ours.seconds)
    peers = {"IPOPT": peer_tries(joint_program(problem.task), problem.task, budget, case.seed)}
    if not case.cyclic and case.objective.form != "peak":
        peers["FATROP"] = peer_tries(staged_program(problem.task), problem.task, budget, case.seed)
    return Race(case=case, redundancy=problem.task.redundancy, ours=ours, peers=peers)


def our_tries(problem: pk.Tracking, seeds: int) -> Tries:
    """Return the results of plans at default settings, one per seed."""
    tries = Tries()
    for seed in range(seeds):
        start = time.process_time()
        try:
            tries.values.append(pk.plan(problem, seed=seed).best.objective)
        except ParetoikError:
            tries.values.append(np.inf)
        tries.seconds.append(time.process_time() - start)
    return tries


def peer_tries(peer: Peer, task: MotionTask, budget: float, seed: int) -> Tries:
    """Return a peer's results in a processor time, from starts like ours alternating with plain rollouts.

    It runs in a process of its own, which ends with its time: FATROP sometimes never returns from a start.
    """
    context, tries = get_context("fork"), Tries()
    reader, writer = context.Pipe(duplex=False)
    process = context.Process(target=_solve_starts, args=(writer, peer, task, budget, seed))
    process.start()
    writer.close()
    with suppress(EOFError):
        while True:
            value, seconds = reader.recv()
            tries.values.append(value)
            tries.seconds.append(seconds)
    process.join()
    remaining = budget - sum(tries.seconds)
    if remaining > 0:  # the last try did not end
        tries.values.append(np.inf)
        tries.seconds.append(remaining)
    return tries


def _solve_starts(writer: Connection, peer: Peer, task: MotionTask, budget: float, seed: int) -> None:
    """Send value and seconds of one start after another until a budget [s] is spent."""
    spent = 0.0
    for q in _starts(task, seed):
        start = time.process_time()
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(start + budget - spent) + 1, resource.RLIM_INFINITY))
        end = peer.solve(q).motion
        seconds = time.process_time() - start
        resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        motion = None if end is None else led_back(task, end)
        feasible = motion is not None and violation(task, motion) <= OPTIONS.violation
        writer.send((float(objectives(task, motion)[0]) if feasible and motion is not None else np.inf, seconds))
        spent += seconds
        if spent >= budget:
            return


def _starts(task: MotionTask, seed: int) -> Iterator[np.ndarray]:
    """Yield starts without end."""
    rng = np.random.default_rng(seed)
    while True:
        both = [sample_starts(task, OPTIONS.starts, rng), rollout_starts(task, OPTIONS.starts, rng)[: OPTIONS.starts]]
        yield from rng.permutation(np.concatenate(both))


@dataclass(frozen=True, kw_only=True)
class Goals:
    """The goals: ours above the peers' best by at most a share ``no_worse``, on a share ``won`` of problems.

    ``time`` is our time to the best over the better peer's; ``hits`` are the shares of seeds that find the best with
    redundancy 1 and 2, and with more.
    """

    no_worse: float = 1e-7
    won: float = 58 / 60
    time: float = 0.5
    hits: tuple[float, float] = (0.95, 0.85)


GOALS = Goals()


def table_rows(races: Sequence[Race]) -> list[Row]:
    """Return the summary, then the rows of all problems, losses first."""
    return summary_rows(races) + losses_first([row for each in races for row in problem_rows(each)])


def summary_rows(races: Sequence[Race]) -> list[Row]:
    """Return the number of problems on which no peer is better, the median time ratio, and hit rates by redundancy."""
    won = sum(each.ours.best <= (1 + GOALS.no_worse) * each.peers_best for each in races)
    ratios = [each.time_ratio for each in races]
    within = f"{sum(ratio <= GOALS.time for ratio in ratios)} of {len(races)} problems within the goal"
    better, row = "no peer better by more than 1e-7", "time to best over the better peer's"
    rows = [
        _summary(better, "problems", won, np.ceil(GOALS.won * len(races)), len(races)),
        Row("summary", row, "median", "", float(np.median(ratios)), source="goal", reference=GOALS.time, note=within),
    ]
    for high, name in enumerate(("redundancy 1 and 2", "redundancy 3 and more")):
        group = [each for each in races if (each.redundancy > 2) == bool(high)]
        if group:
            hits = sum(each.ours.hits(each.best) for each in group)
            tries = sum(len(each.ours.values) for each in group)
            rows.append(
                _summary(f"seeds that find the best, {name}", "share", hits / tries, GOALS.hits[high], len(group))
            )
    return rows


def problem_rows(each: Race) -> list[Row]:
    """Return the rows of one problem: the best values, and the times to the best with every peer's."""
    table, name, best = f"redundancy {each.redundancy}", each.case.name, each.best
    note = f"ours {each.ours.hits(best)} of {len(each.ours.values)} seeds"
    place, goal = (table, name, "best found", each.case.objective.unit), 1 + GOALS.no_worse
    rows = [versus(*place, each.ours.best, each.peers_best, goal=goal, note=note)]
    for peer, tries in each.peers.items():
        note = f"{peer} {tries.hits(best)} of {len(tries.values)} starts"
        times = each.ours.time_to_best(best), tries.time_to_best(best)
        rows.append(versus(table, name, f"time to best, {peer}", "s", *times, goal=GOALS.time, note=note))
    return rows


def _summary(row: str, unit: str, ours: float, goal: float, problems: int) -> Row:
    note = f"{'' if ours >= goal else LOSS}of {problems} problems"
    return Row("summary", row, "all", unit, float(ours), reference=float(goal), source="goal", note=note)
