"""How often default verbs canonicalise a cvxpy statement and run Clarabel, and what share of their time that takes.

The first row is a process's first plan, which imports cvxpy too. Seconds are of the processor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import paretoik as pk
from paretoik.nlp.canonical import CanonicalForm
from paretoik.nlp.criticality import criticality
from paretoik.nlp.subproblem import ConvexSubproblem
from paretoik.pareto import certificates
from problems import panda, tringali_2020
from studies.benchmarks.planner.verdicts import timed
from studies.reporting import Row, tell

POPULATION, GENERATIONS, POINTS = 20, 10, 8
Work = Callable[[], Any]


@dataclass(kw_only=True)
class Count:
    """Calls of a function, and their seconds."""

    calls: int = 0
    seconds: float = 0.0

    def wrap(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function, whose calls are counted."""

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
        patch.object(CanonicalForm, "solve", solved.wrap(CanonicalForm.solve)),
        patch.object(certificates, "criticality", confirmed.wrap(criticality)),
    ):
        yield canonical, solved, confirmed


def verbs(problem: pk.Tracking, one: pk.Tracking) -> dict[str, Work]:
    """Return default verbs by name: of a problem, and of one with a single objective."""
    search: dict[str, Any] = {"population": POPULATION, "generations": GENERATIONS}
    searched = pk.solve(problem, **search, seed=0)
    return {
        "plan": lambda: pk.plan(one).optima,
        "epsilon_front": lambda: pk.epsilon_front(problem, points=POINTS),
        "refine": lambda: pk.refine(searched),
        "solve(refine=True)": lambda: pk.solve(problem, **search, seed=1, refine=True),
        "refine(solver='sqp'), 4 points": lambda: pk.refine(searched[searched.ids[:4]], solver="sqp"),
    }


def count_rows() -> list[Row]:
    """Return what verbs of a 3R arm and of the Panda took."""
    across = panda.across_the_table()
    problems = {
        "3R, 101 samples": (tringali_2020.energy_torque(), tringali_2020.simulation_4()),
        "Panda, 101 samples": tuple(
            pk.Tracking(across.task.arm, across.task.tasks[0].path, objectives=goals, differences="backward")
            for goals in ([pk.kinetic_energy, pk.torque_norm], [pk.kinetic_energy])
        ),
    }
    rows = _counted("a process", "first plan", lambda: pk.plan(problems["3R, 101 samples"][1]).optima)
    for name, (problem, one) in problems.items():
        for verb, work in verbs(problem, one).items():
            rows += _counted(name, verb, work)
    return rows


def _counted(table: str, verb: str, work: Work) -> list[Row]:
    tell(f"{table}: {verb}")
    with counting() as (canonical, solved, confirmed):
        points, _, seconds = timed(work)
    each = 1e3 * confirmed.seconds / max(confirmed.calls, 1)
    return [
        Row(
            table=f"default verbs: {table}",
            row=verb,
            column="share of confirmations",
            unit="%",
            ours=100 * confirmed.seconds / seconds,
            reference=25.0,
            source="goal",
            note=(
                f"{seconds:.2f} s, {len(points)} points; {canonical.calls} canonicalised, {canonical.seconds:.2f} s; "
                f"{solved.calls} solved by Clarabel, {solved.seconds:.2f} s; {confirmed.calls} confirmed, {each:.1f} ms"
            ),
        )
    ]
