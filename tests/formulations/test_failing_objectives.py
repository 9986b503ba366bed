"""Objectives and constraints that fail: they are named, and nothing else fails with them."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import kinetic_energy
from tests.formulations.problems import paper_3r
from tests.formulations.test_tracking import evaluate, genes_of


def is_far(motion):
    return motion.q[..., -1, 0] > 0.3


@pk.objective(unit="rad", form="terminal")
def raising(motion):
    if np.any(is_far(motion)):
        raise ZeroDivisionError("over 0.3")
    return motion.q[..., -1, 0]


def without_a_value(bad):
    return pk.objective(unit="", form="general", name="odd")(lambda motion: np.where(is_far(motion), bad, 1.0))


@pytest.mark.parametrize(
    ("objective", "cause"),
    [
        (raising, "objective raising raised ZeroDivisionError: over 0.3"),
        (without_a_value(np.nan), "objective odd is nan"),
        (without_a_value(-np.inf), "objective odd is -inf"),
    ],
)
def test_an_objective_that_fails_for_some_fails_only_those_and_is_named(objective, cause):
    problem = paper_3r(objectives=[kinetic_energy, objective])
    genes = genes_of(problem, 60)
    out, motions = evaluate(problem, genes), problem.decode(genes)
    failing = is_far(motions)
    assert 3 < failing.sum() < 57
    np.testing.assert_array_equal(out["G"][:, 1], failing)
    assert (out["F"][failing, 1] == np.inf).all()
    np.testing.assert_array_equal(out["F"][~failing, 1], objective(motions[~failing]))
    assert out["cause"].tolist() == [cause if bad else "" for bad in failing]


def test_a_constraint_that_is_nan_makes_the_point_infeasible_and_nothing_else():
    @pk.constraint(unit="rad", form="terminal", upper=10.0)
    def sometimes(motion):
        return np.where(is_far(motion), np.nan, 1.0)

    problem = paper_3r(constraints=[sometimes])
    genes = genes_of(problem, 60)
    out = evaluate(problem, genes)
    failing = is_far(problem.decode(genes))
    np.testing.assert_array_equal((out["G"] > 0).any(axis=1), failing)
    assert np.isfinite(out["G"]).all()
    assert all(bool(cause) == bad for cause, bad in zip(out["cause"], failing, strict=True))
