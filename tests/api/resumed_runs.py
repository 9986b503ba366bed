"""Small runs of every verb that can be resumed, and how to kill one after some entries of its journal.

python -m tests.api.resumed_runs VERB FOLDER ENTRIES
"""

from __future__ import annotations

import os
import signal
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np
from pymoo.core.problem import ElementwiseProblem

import paretoik as pk
from paretoik.runs.journal import Journal
from tests.api.problems import tracking


def loop() -> pk.ClosedLoop:
    path = pk.circle((0.30, 0.10), 0.005, duration=1.0, samples=21)
    objectives = [pk.joint_displacement, pk.position_error]
    return pk.ClosedLoop(pk.arms.tringali_3r(), path, objectives=objectives, population=20, generations=8)


class Slow(ElementwiseProblem):
    """A problem whose rows are evaluated slowly, one by one, and counted in a file."""

    def __init__(self, counted: Path, seconds: float = 0.06) -> None:
        super().__init__(n_var=3, n_obj=2, xl=0.0, xu=1.0)
        self.counted, self.seconds = counted, seconds

    def _evaluate(self, x, out):
        time.sleep(self.seconds)
        with self.counted.open("a") as sink:
            sink.write("x")
        out["F"] = [x[0], (1 - x[0]) ** 2 + x[1] + x[2]]


class Hanging(ElementwiseProblem):
    """A problem in which the first row with the largest gene does not end."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)
        self.worst = pk.Search(self, population=10, seed=1).ask().X[:, 0].max()

    def _evaluate(self, x, out):
        if x[0] == self.worst:
            self.fail()
        out["F"] = [x[0], (1 - x[0]) ** 2 + x[1]]

    def fail(self) -> None:
        while True:
            pass


class Deadly(Hanging):
    """A problem in which one of the first rows ends the process."""

    def fail(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)


PROBLEMS = {
    "search": tracking,
    "solve": tracking,
    "solve from motions": tracking,
    "islands": tracking,
    "loop": loop,
    "plan": lambda: tracking(pk.kinetic_energy, velocity=3.8),
    "epsilon_front": tracking,
    "refine": tracking,
}


def source(problem: pk.Tracking) -> pk.Front:
    return pk.solve(problem, population=12, generations=4, seed=3, points=4)


def run(verb: str, out: Path) -> pk.Front | pk.Plan:
    """Run a verb into a folder."""
    problem = PROBLEMS[verb]()
    match verb:
        case "search":
            return pk.solve(problem, population=12, generations=12, seed=2, out=out, target=[0.0, -np.inf])
        case "solve":
            return pk.solve(problem, population=12, generations=11, seed=1, points=5, refine=True, out=out)
        case "solve from motions":
            motions = source(problem).motions[:2]
            return pk.solve(problem, population=12, generations=4, initial=motions, points=None, out=out)
        case "islands":
            return pk.solve(problem, population=6, generations=24, islands=3, seed=2, stagnation=False, out=out)
        case "loop":
            return pk.solve(problem, out=out, record_steps=[3])
        case "plan":
            motion = source(tracking()).motions[0]
            return pk.plan(problem, starts=6, initial=motion, out=out)
        case "epsilon_front":
            return pk.epsilon_front(problem, points=4, starts=4, out=out)
        case _:
            return pk.refine(source(problem), out=out)


def kill_after(entries: int) -> None:
    """Make this process kill itself when a journal has this number of entries."""
    append, appended = Journal.append, count(1)

    def counted(journal: Journal, *arguments: object) -> None:
        append(journal, *arguments)
        if next(appended) >= entries:
            os.kill(os.getpid(), signal.SIGKILL)

    Journal.append = counted


if __name__ == "__main__":
    verb, folder, entries = sys.argv[1:]
    kill_after(int(entries))
    run(verb, Path(folder))
