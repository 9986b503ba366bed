"""Criticality of points and sets of multipliers, compared with cvxpy, HiGHS and closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from unittest.mock import patch

import cvxpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import linprog, nnls

from paretoik.errors import SolverFailed
from paretoik.nlp import convex_subproblem as canonical
from paretoik.nlp import criticality as multiplier_set
from paretoik.nlp.criticality import (
    OPTIONS,
    _solve_near,
    active_set_criticality,
    criticality,
    quick_criticality,
    share_ranges,
)
from paretoik.nlp.program import Cone, Constraints


def random_point(seed, *, objectives=2, unknowns=40, limits=90):
    rng = np.random.default_rng(seed)
    slopes = sparse.csr_array(sparse.random_array((limits, unknowns), density=0.1, rng=rng))
    gaps = rng.uniform(0, 0.3, size=limits)
    return rng.normal(size=(objectives, unknowns)), Constraints(unknowns=unknowns, values=gaps, jacobian=slopes)


def free(unknowns):
    return Constraints(unknowns=unknowns, values=np.empty(0), jacobian=sparse.csr_array((0, unknowns)))


def stated_in_cvxpy(gradients, constraints, radius):
    """Return value, weights and multipliers of cones by cvxpy's own solve."""
    d, t = cvxpy.Variable(gradients.shape[1]), cvxpy.Variable()
    gains = gradients @ d + t <= 0
    cones = [
        cvxpy.SOC(d[cone.column] + np.linalg.norm(cone.values), cone.values + cone.rows @ d)
        for cone in constraints.cones
    ]
    within = [gains, cvxpy.norm(d[: constraints.unknowns]) <= radius, *cones]
    if len(constraints.values):
        within.append(constraints.values + constraints.jacobian @ d >= 0)
    value = cvxpy.Problem(cvxpy.Maximize(t), within).solve(solver="CLARABEL")
    weights = gains.dual_value
    return value, weights / weights.sum(), [-np.ravel(cone.dual_value[1]) for cone in cones]


@pytest.mark.parametrize("seed", range(3))
def test_clarabel_and_cvxpy_agree(seed):
    point = random_point(seed, objectives=1 + seed % 3)
    ours, (value, weights, _) = criticality(*point, radius=3.0), stated_in_cvxpy(*point, radius=3.0)
    assert ours.value == pytest.approx(value, rel=1e-6)
    assert ours.weights == pytest.approx(weights, abs=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_a_column_that_no_ball_bounds_and_a_cone_agree_with_cvxpy(seed):
    gradients, cone = with_a_cone(seed)
    within = replace(free(6), jacobian=sparse.csr_array((0, 7)), cones=(cone,))
    ours = criticality(gradients, within, radius=0.5)
    value, _, cone_multipliers = stated_in_cvxpy(gradients, within, radius=0.5)
    assert ours.value == pytest.approx(value, rel=1e-6)
    assert ours.cone_multipliers[0] == pytest.approx(cone_multipliers[0], abs=1e-4)


def with_a_cone(seed):
    rng = np.random.default_rng(seed)
    gradients = np.zeros((2, 7))
    gradients[0, :6], gradients[1, 6] = rng.normal(size=6), 1.0
    return gradients, Cone(
        column=6, values=rng.normal(size=3), rows=sparse.csr_array(rng.normal(size=(3, 7)) * ([1.0] * 6 + [0.0]))
    )


def test_a_solver_that_makes_no_progress_is_asked_for_less_and_that_fails_only_if_it_does_again(monkeypatch):
    point, build, tolerances = random_point(1), canonical.clarabel.DefaultSolver, []

    class Stuck:
        status = "InsufficientProgress"

        def solve(self):
            return self

    def solver(*arguments):
        tolerances.append(arguments[-1].tol_feas)
        return Stuck() if tolerances[-1] < lowest else build(*arguments)

    lowest, clean = 1e-10, criticality(*point, radius=3.0)
    monkeypatch.setattr(canonical.clarabel, "DefaultSolver", solver)
    assert criticality(*point, radius=3.0).value == pytest.approx(clean.value, abs=1e-7)
    assert tolerances[:2] == list(OPTIONS.solver_tolerances)
    lowest = 1.0
    with pytest.raises(SolverFailed, match="InsufficientProgress"):
        criticality(*point, radius=3.0)


@pytest.mark.parametrize("seed", range(3))
def test_multipliers_of_active_limits_alone_are_the_conic_programs_where_they_are_unique(seed):
    rng = np.random.default_rng(seed)
    jacobian, multipliers = rng.normal(size=(8, 12)), np.array([0.5, 2.0, 0.0, 1.0, 0, 0, 0, 0])
    slacks = np.where(multipliers > 0, 0.0, rng.uniform(0.5, 1.0, 8))
    gradients = rng.normal(size=(2, 12))
    gradients[1] = (jacobian.T @ multipliers - 0.25 * gradients[0]) / 0.75
    within = Constraints(unknowns=12, values=slacks, jacobian=sparse.csr_array(jacobian))
    fast = active_set_criticality(gradients, within, 2.0)
    conic = _solve_near(gradients, within, 2.0, np.arange(8))
    assert fast is not None
    assert fast.value == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(fast.weights, [0.25, 0.75], atol=1e-9)
    np.testing.assert_allclose(fast.multipliers, multipliers, atol=1e-8)
    np.testing.assert_allclose(conic.multipliers, fast.multipliers, atol=1e-5)
    assert active_set_criticality(gradients + 0.01 * rng.normal(size=(2, 12)), within, 2.0) is None


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_at_a_corner_the_criticality_is_the_distance_of_gradients_from_the_cone_of_limits(seed):
    """All limits active and some twice: χ = radius · min ‖Σ λᵢ ∇fᵢ − Jᵀ μ‖ (closed form), degenerate multipliers."""
    rng = np.random.default_rng(seed)
    objectives, limits = 1 + seed % 3, 6
    gradients, jacobian = rng.normal(size=(objectives, 12)), rng.normal(size=(limits, 12))
    jacobian = np.concatenate([jacobian, 3.0 * jacobian[:3], jacobian[:1] + jacobian[1:2]])
    if seed >= 4:  # a critical point, whose multipliers are not unique
        gradients[-1] = (jacobian.T @ rng.uniform(0, 1, len(jacobian)) - gradients[:-1].sum(axis=0)) / 2
    heavy = 1e6 * np.concatenate([np.ones(objectives), np.zeros(len(jacobian))])  # Σ λ = 1
    dual = nnls(np.vstack([np.hstack([gradients.T, -jacobian.T]), heavy]), np.append(np.zeros(12), 1e6))[0]
    distance = np.linalg.norm(gradients.T @ dual[:objectives] - jacobian.T @ dual[objectives:])
    within = Constraints(unknowns=12, values=np.zeros(len(jacobian)), jacobian=sparse.csr_array(jacobian))
    assert criticality(gradients, within, 2.0).value == pytest.approx(2.0 * distance, rel=1e-6, abs=1e-8)
    assert quick_criticality(gradients, within, 2.0).value == pytest.approx(2.0 * distance, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_with_peaks_kinks_and_far_limits_cvxpy_finds_the_same_criticality_and_weak_duality_is_tight(seed):
    """Column 8 is the epigraph of a peak, column 9 of an absolute value; some of the limits are active."""
    rng = np.random.default_rng(seed)
    n = 8
    pieces, kink = rng.normal(size=(4, n)), rng.normal(size=n)
    limits = rng.normal(size=(5, n))
    jacobian = np.zeros((11, n + 2))
    jacobian[:5, :n], jacobian[5:9, :n], jacobian[5:9, n] = limits, -pieces, 1.0
    jacobian[9:, :n], jacobian[9:, n + 1] = [-kink, kink], 1.0
    slacks = np.concatenate([[0, 0, 0.1, 0.3, 9.0], [0, 0, 0.2, 1.0], [0, 0]])
    gradients = np.zeros((2, n + 2))
    gradients[:, :n], gradients[0, n], gradients[1, n + 1] = rng.normal(size=(2, n)), 1.0, 0.5
    within = Constraints(unknowns=n, values=slacks, jacobian=sparse.csr_array(jacobian))
    ours = criticality(gradients, within, 1.0)
    assert ours.value == pytest.approx(stated_in_cvxpy(gradients, within, 1.0)[0], rel=1e-6, abs=1e-7)
    bound = np.linalg.norm((gradients.T @ ours.weights - jacobian.T @ ours.multipliers)[:n])
    assert bound + ours.multipliers @ slacks == pytest.approx(ours.value, rel=1e-6, abs=1e-7)


# The set of multipliers, with many points, one or none, compared with a linear program for every entry.


def shares_by_linear_programs(gradients, active):
    """Return the least and largest λᵢ / (λᵢ + λⱼ), each by HiGHS over λ and μ."""
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
    """Return gradients of a critical point: active ones of a rank; objectives' in their cone but for λ's part."""
    rng = np.random.default_rng(seed)
    active = rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))
    multipliers = rng.uniform(0.1, 1.0, size=(objectives, rows))
    return multipliers @ active, active


@settings(deadline=None, max_examples=10)
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


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 10**6), objectives=st.integers(2, 4), rows=st.integers(0, 8), columns=st.integers(12, 20))
def test_where_the_weights_are_unique_no_solver_is_asked_though_multipliers_may_not_be(seed, objectives, rows, columns):
    rng = np.random.default_rng(seed)
    active = rng.normal(size=(rows // 2 + 1, columns))
    active = np.concatenate([active, active])  # every row twice: no μ is unique
    gradients = rng.normal(size=(objectives, columns))
    gradients[-1] = (rng.uniform(0.1, 1.0, len(active)) @ active - gradients[:-1].sum(axis=0)) / 2
    with patch.object(multiplier_set, "_extreme_shares", side_effect=AssertionError("asked")):
        assert share_ranges(gradients, active) is None
