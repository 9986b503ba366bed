"""The loop of a search, and evaluations that fail in it."""

from __future__ import annotations

import signal

import numpy as np
import pytest

from paretoik.errors import EvaluationFailed
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Evaluations, Generations
from paretoik.search.evolution import evaluate_rows, evolve
from tests.search.problems import Parabolas


def search(problem=None, **settings):
    return Search(problem or Parabolas(), population=10, seed=1, **settings)


def test_search_runs_until_the_first_ending_and_shows_each_generation():
    seen = []
    running = search()
    assert evolve(running, [Generations(7), Evaluations(1000)], observe=seen.append) == "generations"
    assert [progress.generation for progress in seen] == [1, 2, 3, 4, 5, 6, 7]
    assert [progress.evaluations for progress in seen] == list(range(10, 80, 10))
    assert np.array_equal(seen[-1].front, running.archive.F)
    assert np.array_equal(seen[-1].ids, running.archive.ids)
    assert seen[-1].population.shape == (10, 2)
    assert seen[0].seconds <= seen[-1].seconds
    assert evolve(search(), [Generations(70), Evaluations(35)]) == "evaluations"


class Raising(Parabolas):
    """Raises if an individual is in a corner of the box."""

    def _evaluate(self, x, out, *args, **kwargs):
        if (x[:, 1] > 1.0).any():
            raise ArithmeticError("elbow\nlocked")
        super()._evaluate(x, out)


def test_one_individual_that_raises_does_not_take_the_others_with_it():
    X = np.zeros((5, 3))
    X[2, 1] = 1.5
    problem = Raising()
    outcome = evaluate_rows(problem, lambda genes: problem.evaluate(genes, return_as_dictionary=True), X)
    assert np.isnan(outcome["F"]).all(axis=1).tolist() == [False, False, True, False, False]
    assert outcome["cause"].tolist() == ["", "", "the problem raised ArithmeticError: elbow locked", "", ""]


class Explaining(Parabolas):
    """Gives the cause of each row, and may also raise."""

    def _evaluate(self, x, out, *args, **kwargs):
        if (x[:, 2] > 1.9).any():
            raise ArithmeticError
        super()._evaluate(x, out)
        bad = x[:, 1] > 1.0
        out["F"][bad] = np.inf
        out["cause"] = np.where(bad, "elbow locked", "").astype(object)


def test_causes_that_the_evaluation_itself_names_are_kept():
    X = np.zeros((4, 3))
    X[1, 1] = 1.5
    problem = Explaining()
    for risky in (0.0, 2.0):
        X[3, 2] = risky
        outcome = evaluate_rows(problem, lambda genes: problem.evaluate(genes, return_as_dictionary=True), X)
        assert outcome["cause"][1] == "elbow locked"
        assert (outcome["cause"] != "").sum() == (2 if risky else 1)
    running = search(problem)
    evolve(running, [Generations(5)])
    assert running.failed.count > 0
    assert running.failed.first_cause in ("elbow locked", "the problem raised ArithmeticError")


class Broken(Parabolas):
    def _evaluate(self, x, out, *args, **kwargs):
        raise TypeError("wrist_effort: unexpected argument")


class Misshapen(Parabolas):
    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = np.zeros((len(x), 3))


@pytest.mark.parametrize(
    ("problem", "cause"),
    [
        (
            Broken(),
            "10 failed evaluations, the first with: the problem raised TypeError: wrist_effort: unexpected argument",
        ),
        (Misshapen(), r"got 10 failed evaluations, the first with: .*expected shape \(1, 2\) but provided \(1, 3\)"),
    ],
)
def test_search_without_a_usable_evaluation_ends_with_the_first_cause(problem, cause):
    with pytest.raises(EvaluationFailed, match=cause):
        evolve(search(problem), [Generations(5)])


def test_ctrl_c_during_an_evaluation_keeps_the_result():
    class Impatient(Parabolas):
        def _evaluate(self, x, out, *args, **kwargs):
            super()._evaluate(x, out)
            if self.calls == 5:  # of four generations: the first row is evaluated twice
                signal.raise_signal(signal.SIGINT)

    running = search(Impatient())
    assert evolve(running, [Generations(50)]) == "interrupted"
    assert running.generation == 3
    assert len(running.archive) > 0
    asked = running.ask()
    assert asked.generation == 3
    running.tell(asked.ids, Parabolas().evaluate(asked.X))
    assert running.generation == 4


def test_improved_genes_are_evaluated_in_the_next_generation():
    better = np.array([[0.5, 0.0, 0.0]])
    running = search()
    evolve(running, [Generations(3)], improve=lambda progress: better if progress.generation == 1 else None)
    row = np.flatnonzero(np.equal(running.archive.members.X, better[0]).all(axis=1))
    assert running.archive.members.generations[row].tolist() == [1]


def test_evaluation_may_happen_elsewhere():
    def remote(X):
        return {"F": Parabolas().evaluate(X)}

    near, far = search(), search(Broken())
    evolve(near, [Generations(5)])
    evolve(far, [Generations(5)], evaluate=remote)
    assert np.array_equal(near.archive.members.X, far.archive.members.X)


def test_equality_constraints_count():
    class OnALine(Parabolas):
        def __init__(self):
            super().__init__()
            self.n_eq_constr = 1

        def _evaluate(self, x, out, *args, **kwargs):
            super()._evaluate(x, out)
            out["H"] = x[:, 1:2] - 0.5

    running = search(OnALine(), initial=[[0.2, 0.5, 0.1], [0.6, 0.5, 0.1], [0.6, 0.4, 0.0]])
    evolve(running, [Generations(10)])
    assert len(running.archive) >= 2
    assert np.allclose(running.archive.members.X[:, 1], 0.5, atol=1e-4)
