"""Counts of default verbs: conic programs and their share of the time, and the stated time left.

The first row is a process's first plan, which imports cvxpy too; the last ones are the memory of processes that confirm
one point. Seconds are of the processor. A stated time left is right within a factor of 2, or if both are less than half
a second; only statements in the last 80 % of a run count.
"""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np

import paretoik as pk
from paretoik.compilation_notices import computing_clock
from paretoik.nlp.convex_subproblem import ConvexSubproblem
from paretoik.nlp.criticality import criticality
from paretoik.pareto import certificates
from paretoik.progress import Observer, RunProgress
from paretoik.runs.distribution import Done
from paretoik.runs.processes import WorkerProcesses
from problems import panda, tringali_2020
from studies.reporting import Row, tell, timed

POPULATION, GENERATIONS, POINTS = 20, 10, 8
Work = Callable[[], Any]


@dataclass(kw_only=True)
class Count:
    """Calls of a function, and their seconds."""

    calls: int = 0
    seconds: float = 0.0

    def wrap(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its calls counted."""

        def counted(*arguments: Any, **settings: Any) -> Any:
            self.calls += 1
            result, _, seconds = timed(lambda: function(*arguments, **settings))
            self.seconds += seconds
            return result

        return counted


@contextmanager
def counting() -> Iterator[tuple[Count, Count, Count]]:
    """Yield the counts of canonicalisations, Clarabel's solutions and confirmed points."""
    canonical, solved, confirmed = Count(), Count(), Count()
    with (
        patch.object(ConvexSubproblem, "__init__", canonical.wrap(ConvexSubproblem.__init__)),
        patch.object(ConvexSubproblem, "solve", solved.wrap(ConvexSubproblem.solve)),
        patch.object(certificates, "criticality", confirmed.wrap(criticality)),
    ):
        yield canonical, solved, confirmed


def verbs(problem: pk.Tracking, one: pk.Tracking) -> dict[str, Work]:
    """Return default verbs by name: for a problem, and for one with a single objective."""
    search: dict[str, Any] = {"population": POPULATION, "generations": GENERATIONS}
    searched = pk.solve(problem, **search, seed=0)
    return {
        "plan": lambda: pk.plan(one).optima,
        "epsilon_front": lambda: pk.epsilon_front(problem, points=POINTS),
        "refine": lambda: pk.refine(searched),
        "solve(refine=True)": lambda: pk.solve(problem, **search, seed=1, refine=True),
        "refine(solver='sqp'), 4 points": lambda: pk.refine(searched[searched.ids[:4]], solver="sqp"),
    }


BEGINNING, FACTOR, SHORT = 0.2, 2.0, 0.5  # share of a run that is not judged; of the true time; seconds


def timed_runs() -> dict[str, Callable[[Observer], Any]]:
    """Return runs of every kind by name, which report their progress to their observer."""
    planar, hand = tringali_2020.energy_torque().task, panda.across_the_table().task
    goals = [pk.kinetic_energy, pk.torque_norm]
    search: dict[str, Any] = {"population": POPULATION, "generations": GENERATIONS, "seed": 1, "refine": True}
    limits = pk.Limits(velocity=3.2, acceleration=30.0, torque=1.5)
    three = pk.Tracking(planar.arm, planar.tasks[0].path, objectives=goals, limits=limits)
    seven = pk.Tracking(hand.arm, hand.tasks[0].path, objectives=goals)
    one = pk.Tracking(hand.arm, hand.tasks[0].path, objectives=goals[:1])
    lamp = [pk.obstacles.Sphere([0.3, 0.0, 0.8], 0.1)]
    beside = pk.Tracking(hand.arm, hand.tasks[0].path, objectives=goals, obstacles=lamp, link_radius=0.06)
    searched = pk.solve(three, population=60, generations=30, seed=2, points=40, observe=False)
    return {
        "solve(refine=True), 3R": lambda seen: pk.solve(three, **search, points=30, observe=seen),
        "solve(refine=True), Panda": lambda seen: pk.solve(seven, **search, points=10, observe=seen),
        "the same, obstacle": lambda seen: pk.solve(beside, **search, points=8, observe=seen),
        "plan, Panda": lambda seen: pk.plan(one, observe=seen),
        "epsilon_front, 3R": lambda seen: pk.epsilon_front(three, points=20, observe=seen),
        "epsilon_front, Panda": lambda seen: pk.epsilon_front(seven, points=8, observe=seen),
        "refine, 3R": lambda seen: pk.refine(searched, observe=seen),
        "refine, 3R, 2 workers": lambda seen: pk.refine(searched, workers=2, observe=seen),
    }


def time_left_rows() -> list[Row]:
    """Return how often the time left that runs state is right."""
    return [_time_left_row(name, work) for name, work in timed_runs().items()]


def _time_left_row(name: str, work: Callable[[Observer], Any]) -> Row:
    tell(name)
    began, stated = computing_clock(), list[tuple[float, float, str]]()

    def watch(progress: RunProgress) -> None:
        if progress.remaining is not None:
            stated.append((computing_clock() - began, progress.remaining, progress.stage))

    work(watch)
    end = computing_clock() - began
    judged = [(end - passed, left, stage) for passed, left, stage in stated if passed >= BEGINNING * end]
    right = [true / FACTOR <= left <= FACTOR * true or max(true, left) < SHORT for true, left, _ in judged]
    stages = []
    for stage in dict.fromkeys(stage for *_, stage in judged):
        ratios = [left / max(true, 1e-3) for true, left, each in judged if each == stage and true >= SHORT]
        if ratios:
            stages.append(f"{stage} {min(ratios):.2g} to {max(ratios):.2g}")
    note = f"{end:.1f} s, {len(judged)} statements; stated over true: {', '.join(stages) or 'none'}"
    value = 100 * float(np.mean(right)) if right else float("nan")
    return Row("time left", name, "right within a factor of 2", "%", value, note=note)


def count_rows() -> list[Row]:
    """Return the counts and times of verbs for a 3R arm and the Panda."""
    across = panda.across_the_table()
    problems = {
        "3R, 101 samples": (tringali_2020.energy_torque(), tringali_2020.simulation_4()),
        "Panda, 101 samples": tuple(
            pk.Tracking(across.task.arm, across.task.tasks[0].path, objectives=goals, differences="backward")
            for goals in ([pk.kinetic_energy, pk.torque_norm], [pk.kinetic_energy])
        ),
    }
    memory = memory_rows()  # first: a child's peak memory begins with its parent's
    rows = _counted("a process", "first plan", lambda: pk.plan(problems["3R, 101 samples"][1]).optima)
    for name, (problem, one) in problems.items():
        for verb, work in verbs(problem, one).items():
            rows += _counted(name, verb, work)
    return rows + memory


def confirm(_: None, samples: int) -> tuple[float, float]:
    """Return the peak memory of this process [MB] after confirming a Panda's motion with kinks, and the seconds."""
    path = pk.line([0.45, -0.2, 0.4], [0.45, 0.2, 0.4], duration=1.5, samples=samples)
    goals = [pk.kinetic_energy, pk.peak_velocity, pk.mechanical_energy]
    problem = pk.Tracking(panda.panda(), path, objectives=goals)
    front = pk.solve(problem, population=12, generations=2, points=1, seed=1, observe=False)
    point = problem.front_points(front)[0]
    seconds = timed(lambda: certificates.confirmed_criticality(problem.program(), point))[2]
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3, seconds


def memory_rows() -> list[Row]:
    """Return the memory and the time of a process that confirms one point, by the number of samples."""
    rows = []
    for samples in (41, 81, 161):
        tell(f"memory: {samples} samples")
        for _ in range(2):  # the first one may compile
            with closing(WorkerProcesses(1)) as fresh:
                ((_, reply),) = fresh.replies(confirm, None, [samples])
        assert isinstance(reply, Done)
        memory, seconds = reply.value
        note = f"{seconds:.2f} s to state and solve its convex program"
        rows.append(
            Row("confirming a Panda's point, kinks", f"{samples} samples", "peak memory", "MB", memory, note=note)
        )
    return rows


def _counted(table: str, verb: str, work: Work) -> list[Row]:
    tell(f"{table}: {verb}")
    with counting() as (canonical, solved, confirmed):
        points, _, seconds = timed(work)
    share, each = 100 * confirmed.seconds / seconds, 1e3 * confirmed.seconds / max(confirmed.calls, 1)
    note = f"{seconds:.2f} s, {len(points)} points; {canonical.calls} canonicalised, {canonical.seconds:.2f} s; "
    note += f"{solved.calls} solved by Clarabel, {solved.seconds:.2f} s; {confirmed.calls} confirmed, {each:.1f} ms"
    place = f"default verbs: {table}", verb, "share of confirmations", "%"
    return [Row(*place, share, reference=25.0, source="goal", note=note)]
