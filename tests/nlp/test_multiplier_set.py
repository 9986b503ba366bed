"""The set of multipliers beside a linear program for every entry, where it has many points, one or none."""

from __future__ import annotations

from itertools import permutations
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from paretoik.errors import SolverFailed
from paretoik.nlp import criticality as multiplier_set
from paretoik.nlp.criticality import share_ranges


def shares_by_linear_programs(gradients, active):
    """The least and largest λᵢ / (λᵢ + λⱼ), each by HiGHS over λ and μ themselves."""
    count, rows = len(gradients), len(active)
    shares = np.full((count, count, 2), 0.5)
    for i, j in permutations(range(count), 2):
        pair = np.zeros(count + rows)
        pair[[i, j]] = 1.0
        balance = np.concatenate([gradients, -active]).T
        for side, sign in enumerate((1.0, -1.0)):
            cost = np.zeros(count + rows)
            cost[i] = sign
            end = linprog(cost, A_eq=np.vstack([pair, balance]), b_eq=np.append(1.0, np.zeros(balance.shape[0])))
            assert end.status == 0
            shares[i, j, side] = end.x[i]
    return shares


def critical(seed, objectives, rows, columns, rank):
    """Gradients of a critical point: active ones of a rank, those of objectives in their cone but for λ's part."""
    rng = np.random.default_rng(seed)
    active = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))
    multipliers = rng.uniform(0.1, 1.0, size=(objectives, rows))
    return multipliers @ active, active


@settings(deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 10**6),
    objectives=st.integers(2, 4),
    columns=st.integers(2, 12),
    extra=st.integers(0, 4),
    lost=st.integers(0, 3),
)
def test_all_shares_are_those_of_a_linear_program_each(seed, objectives, columns, extra, lost):
    rank = max(columns - lost, 1)
    gradients, active = critical(seed, objectives, rank + extra, columns, rank)
    shares = share_ranges(gradients, active)
    assert shares is not None
    np.testing.assert_allclose(shares, shares_by_linear_programs(gradients, active), atol=2e-6)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10**6), objectives=st.integers(2, 4), rows=st.integers(0, 8), columns=st.integers(12, 20))
def test_where_the_weights_are_unique_no_solver_is_asked_though_multipliers_may_not_be(seed, objectives, rows, columns):
    rng = np.random.default_rng(seed)
    active = rng.normal(size=(rows // 2 + 1, columns))
    active = np.concatenate([active, active])  # every row twice: no μ is unique
    gradients = rng.normal(size=(objectives, columns))
    gradients[-1] = (rng.uniform(0.1, 1.0, len(active)) @ active - gradients[:-1].sum(axis=0)) / 2
    with patch.object(multiplier_set, "_extreme_shares", side_effect=AssertionError("asked")):
        assert share_ranges(gradients, active) is None


def test_without_active_rows_opposed_gradients_alone_decide():
    assert share_ranges(np.array([[1.0, 0.0], [-2.0, 0.0]]), np.zeros((0, 2))) is None
    stationary = share_ranges(np.zeros((2, 2)), np.zeros((0, 2)))  # any weights serve where nothing changes
    assert stationary is not None
    np.testing.assert_allclose(stationary[0, 1], [0.0, 1.0], atol=1e-6)


def test_units_of_limits_do_not_matter():
    gradients, active = critical(3, 3, 7, 5, 5)
    scaled = active * np.logspace(-6, 6, len(active))[:, None]
    np.testing.assert_allclose(share_ranges(1e5 * gradients, scaled), share_ranges(gradients, active), atol=1e-6)


def test_a_set_that_is_empty_fails_with_how_the_solver_ended():
    with pytest.raises(SolverFailed, match=r"multipliers: HiGHS wanted to end with an optimum, got .*infeasible"):
        share_ranges(np.array([[1.0, 0.0], [2.0, 0.0]]), np.array([[-1.0, 0.0]]))
