"""Operators for smooth genes stay in bounds, and move what they say."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.problem import Problem

from paretoik.search.operators import Differential, SmoothMutation

ROW = 6


def problem() -> Problem:
    return Problem(n_var=1 + 2 * ROW, n_obj=2, xl=np.r_[0.0, -np.ones(2 * ROW)], xu=np.r_[3.0, np.ones(2 * ROW)])


def individuals(rng, shape):
    box = problem()
    return box.xl + rng.random((*shape, box.n_var)) * (box.xu - box.xl)


@given(st.integers(0, 2**32 - 1))
def test_a_differential_step_moves_along_the_difference_and_stays_in_the_bounds(seed):
    rng = np.random.default_rng(seed)
    X = individuals(rng, (3, 20))
    (made,) = Differential()._do(problem(), X, random_state=rng)
    assert (made >= problem().xl).all()
    assert (made <= problem().xu).all()
    free = (made > problem().xl) & (made < problem().xu)
    step, difference = made - X[0], X[1] - X[2]
    ratios = np.divide(step, difference, out=np.full_like(step, np.nan), where=free & (np.abs(difference) > 1e-6))
    allowed = np.isnan(ratios) | np.isclose(ratios[..., None], [0.3, 0.6, 1.0], rtol=1e-6).any(axis=-1)
    assert allowed.all()


def test_parents_that_agree_have_the_first_as_offspring():
    rng = np.random.default_rng(0)
    X = individuals(rng, (3, 20))
    X[2] = X[1]
    assert np.array_equal(Differential()._do(problem(), X, random_state=rng)[0], X[0])


@given(st.integers(0, 2**32 - 1))
def test_a_smooth_mutation_moves_one_row_in_the_bounds_and_never_the_genes_before_the_rows(seed):
    rng = np.random.default_rng(seed)
    X = individuals(rng, (20,))
    made = SmoothMutation(ROW)._do(problem(), X, random_state=rng)
    assert (made >= problem().xl).all()
    assert (made <= problem().xu).all()
    assert np.array_equal(made[:, 0], X[:, 0])
    moved = (made != X)[:, 1:].reshape(20, 2, ROW).any(axis=2)
    assert (moved.sum(axis=1) <= 1).all()
    assert moved.any()
