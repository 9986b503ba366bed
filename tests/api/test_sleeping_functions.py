"""A user's function that does not return is ended by the time limit or the evaluation timeout."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pymoo.core.problem import Problem

import paretoik as pk
from paretoik.api.load import named_problem
from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.inputs import CallLimitOptions
from paretoik.runs.interruption import limited_evaluations
from paretoik.stop_flag import STOP
from paretoik.task.motion_task import require_values

SLEEP = 30.0  # s: longer than any test may take
ARM, LINE = pk.arms.tringali_3r(), pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11)


class Sleeper:
    """An objective whose calls sleep from number ``first`` on."""

    def __init__(self, first: float = np.inf) -> None:
        self.first, self.calls = first, 0

    def __call__(self, motion):
        self.calls += 1
        if self.calls >= self.first:
            try:
                time.sleep(SLEEP)
            except Exception:  # a user's code may catch any error
                time.sleep(SLEEP)
        return np.sum(motion.q[..., 1:-1, :] ** 2, axis=(-1, -2))


def sleeping_problem(count: int = 2) -> tuple[pk.Tracking, Sleeper]:
    """Return a problem whose last objective can sleep, with that objective."""
    sleeper = Sleeper()
    slow = pk.objective(unit="rad²", form="general", name="slow")(sleeper)
    return pk.Tracking(ARM, LINE, objectives=[pk.kinetic_energy, slow][-count:]), sleeper


@pytest.fixture(autouse=True)
def in_time():
    """No test of this file waits for a sleeping function, or leaves a limit or a flag set."""
    began = time.monotonic()
    yield
    assert time.monotonic() - began < SLEEP
    assert not STOP[0]


VERBS = {
    "solve": lambda problem, **options: pk.solve(problem, population=8, **options),
    "epsilon_front": lambda problem, **options: pk.epsilon_front(problem, points=3, starts=2, **options),
    "plan": lambda problem, **options: pk.plan(problem, starts=2, **options),
}


@pytest.mark.parametrize("verb", VERBS)
def test_a_time_limit_ends_the_first_evaluation_and_names_the_function(verb):
    problem, sleeper = sleeping_problem(1 if verb == "plan" else 2)
    sleeper.first = 0
    with pytest.raises(SolverFailed) as failure:
        VERBS[verb](problem, time_limit=0.5, observe=False)
    assert "time_limit: nothing was found within 0.5 s" in str(failure.value)
    assert "objective slow took longer than that" in str(failure.value)


def test_a_time_limit_ends_a_later_generation_and_keeps_the_front(tmp_path):
    problem, sleeper = sleeping_problem()
    sleeper.first = sleeper.calls + 5
    front = pk.solve(problem, population=8, time_limit=1.0, out=tmp_path / "run", observe=False)
    assert front.provenance["status"] == "time limit"
    assert front.provenance["counts"]["generations"] >= 1
    assert len(pk.load_front(tmp_path / "run")) == len(front) > 0


FILE = """
import time

import numpy as np

import paretoik as pk

{module}


@pk.objective(unit="rad²", form="general")
def slow(motion):
    time.sleep(30)
    return np.zeros(motion.q.shape[:-2])


def mine() -> pk.Tracking:
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, slow])
"""


def test_a_time_limit_ends_construction(tmp_path):
    (tmp_path / "sleeping_objective.py").write_text(FILE.format(module=""))
    with pytest.raises(SolverFailed, match=r"no problem was built within 1 s; objective slow took longer than that"):
        named_problem(f"{tmp_path / 'sleeping_objective.py'}:mine", time_limit=1)


def test_an_evaluation_timeout_fails_only_the_late_call():
    problem, sleeper = sleeping_problem()
    motions = problem.task.motion(problem._rollouts[:2])
    sleeper.first = 0
    words = r"every evaluation failed, the first with: objective slow took longer than the evaluation timeout of 0\.1 s"
    with limited_evaluations(0.1), pytest.raises(EvaluationFailed, match=words):
        require_values(problem.task, motions)


def test_a_time_limit_ends_a_module_that_does_not_return(tmp_path, monkeypatch):
    monkeypatch.setattr("paretoik.runs.interruption.CALLS", CallLimitOptions(loading=0.5))
    (tmp_path / "sleeping_module.py").write_text(FILE.format(module="time.sleep(30)"))
    with pytest.raises(SolverFailed, match=r"no problem was built within 0\.5 s; problem file .* took longer"):
        named_problem(f"{tmp_path / 'sleeping_module.py'}:mine", time_limit=0.5)


class SleepingProblem(Problem):
    """A pymoo problem whose evaluation does not return."""

    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def _evaluate(self, x, out, *arguments, **named):
        time.sleep(SLEEP)


@pytest.mark.parametrize("workers", [None, 1])
def test_a_time_limit_ends_an_evaluation_of_a_pymoo_problem_here_and_in_workers(workers):
    with pytest.raises(SolverFailed, match=r"time_limit: nothing was found within 0\.5 s"):
        pk.solve(SleepingProblem(), population=4, time_limit=0.5, workers=workers, observe=False)
