"""Sparse products have the structure that their factors' structures define; violations of a program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.program import Structure, structural_product, violation_at, violation_of


@pytest.mark.parametrize("seed", range(20))
def test_a_structural_product_is_the_product_and_keeps_sums_that_are_zero_by_chance(seed):
    rng = np.random.default_rng(seed)
    rows, inner, columns = rng.integers(1, 30, 3)
    left, right = (
        sparse.csr_array(sparse.random_array(shape, density=0.2, rng=rng))
        for shape in ((rows, inner), (inner, columns))
    )
    everywhere = Structure.of(structural_product(left, right))
    for matrix in (left, right):
        matrix.data = rng.integers(-1, 2, len(matrix.data)).astype(float)
    product = structural_product(left, right)
    product.check_format()
    np.testing.assert_array_equal(product.toarray(), left.toarray() @ right.toarray())
    assert Structure.of(product) == everywhere


# Violations of a program: the largest of all excesses, each computed by hand.


def program(**changes):
    """A program of (x, y): objectives x and y, the equality x = y, the inequality x ≥ 1."""
    rows = trace_rows(2, 0, lambda z, _: ([z[0] - z[1]], [z[0] - 1.0])).at()
    return replace(DenseProgram(rows=rows, costs=np.eye(2), objective_names=("x", "y")), **changes)


def test_the_worst_of_equalities_and_inequalities_counts():
    none, one = np.zeros(1), np.ones(1)
    assert violation_of(program(), np.zeros(2), none, one) == 0.0
    assert violation_of(program(), np.zeros(2), np.array([-3.0]), one) == 3.0
    assert violation_of(program(), np.zeros(2), one, np.array([-2.0])) == 2.0


def test_bounds_on_objectives_count_by_rows_or_those_of_the_program():
    F, none, one = np.array([5.0, 1.0]), np.zeros(1), np.ones(1)
    bounds = np.array([3.0, np.inf])
    assert violation_of(program(), F, none, one, np.array([[1.0, -1.0]]), np.array([1.0])) == 3.0
    assert violation_of(program(), F, none, one, np.eye(2), bounds) == 2.0
    assert violation_of(program(), np.array([np.inf, 1.0]), none, one) == 0.0


def test_nan_is_not_feasible():
    assert np.isnan(violation_of(program(), np.zeros(2), np.array([np.nan]), np.ones(1)))


@pytest.mark.parametrize("x", [[0.5, 0.5], [2.0, -1.0], [1.5, 1.5]])
def test_a_linearised_point_has_the_violation_of_its_values(x):
    x = np.array(x)
    F, equalities, inequalities = program().evaluate(x)
    expected = max(0.0, abs(x[0] - x[1]), 1.0 - x[0])
    assert violation_of(program(), F, equalities, inequalities) == pytest.approx(expected)
    assert violation_at(program(), program().linearise(x)) == pytest.approx(expected)
