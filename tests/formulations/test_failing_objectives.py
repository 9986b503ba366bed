"""Objectives and constraints that fail: they are named, and nothing else fails with them."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import kinetic_energy
from paretoik.errors import InvalidInput
from tests.formulations.problems import paper_3r
from tests.formulations.test_tracking import evaluate, genes_of


def test_an_objective_that_raises_for_some_fails_only_those_and_is_named():
    @pk.objective(unit="rad", form="terminal")
    def picky(motion):
        if np.any(motion.q[..., -1, 0] > 0.3):
            raise ZeroDivisionError("over 0.3")
        return motion.q[..., -1, 0]

    problem = paper_3r(objectives=[kinetic_energy, picky])
    genes = genes_of(problem, 60)
    out = evaluate(problem, genes)
    failing = problem.decode(genes).q[:, -1, 0] > 0.3
    assert 3 < failing.sum() < 57
    np.testing.assert_array_equal(out["G"][:, 1], failing)
    assert np.isinf(out["F"][failing, 1]).all()
    np.testing.assert_array_equal(out["F"][~failing, 1], problem.decode(genes).q[~failing, -1, 0])
    named = ["picky" in cause and "ZeroDivisionError: over 0.3" in cause for cause in out["cause"]]
    assert named == failing.tolist()
    assert not any(cause for cause, bad in zip(out["cause"], failing, strict=True) if not bad)
    assert not np.isnan(out["F"]).any()


@pytest.mark.parametrize("bad", [np.nan, -np.inf])
def test_an_objective_without_a_finite_value_fails_the_point_and_is_named(bad):
    @pk.objective(unit="", form="general")
    def sometimes(motion):
        return np.where(motion.q[..., -1, 0] > 0.3, bad, 1.0)

    problem = paper_3r(objectives=[kinetic_energy, sometimes])
    genes = genes_of(problem, 60)
    out = evaluate(problem, genes)
    failing = problem.decode(genes).q[:, -1, 0] > 0.3
    assert 3 < failing.sum() < 57
    np.testing.assert_array_equal(out["G"][:, 1] > 0, failing)
    assert (out["F"][failing, 1] == np.inf).all()
    assert [cause for cause in out["cause"] if cause] == [f"objective sometimes is {bad}"] * failing.sum()


def test_a_constraint_that_is_nan_makes_the_point_infeasible_and_nothing_else():
    @pk.constraint(unit="rad", form="terminal", upper=10.0)
    def sometimes(motion):
        return np.where(motion.q[..., -1, 0] > 0.3, np.nan, 1.0)

    problem = paper_3r(constraints=[sometimes])
    genes = genes_of(problem, 60)
    out = evaluate(problem, genes)
    failing = problem.decode(genes).q[:, -1, 0] > 0.3
    np.testing.assert_array_equal((out["G"] > 0).any(axis=1), failing)
    assert np.isfinite(out["G"]).all()
    assert all(bool(cause) == bad for cause, bad in zip(out["cause"], failing, strict=True))


class Raising:
    def __array__(self, *_, **__):
        return 1 / 0


@pytest.mark.parametrize(
    ("returns", "words"),
    [
        (
            lambda motion: motion.q,
            r"objective odd \(integral\) must return shape .*, here \(.*, 21\), got \(.*, 21, 3\)",
        ),
        (lambda motion: np.ma.masked_less(motion.q[..., 0], np.inf), "odd must return real numbers, got masked ones"),
        (lambda motion: Raising(), "objective odd .* must return shape .*, got ZeroDivisionError: division by zero"),
    ],
    ids=["shape", "masked", "raising"],
)
def test_an_objective_that_returns_something_else_is_refused_by_name(returns, words):
    odd = pk.objective(unit="", form="integral", name="odd")(returns)
    with pytest.raises(InvalidInput, match=words):
        paper_3r(objectives=[odd])
