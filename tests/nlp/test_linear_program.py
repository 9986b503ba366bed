"""How far columns reach along a direction: the linear program, and the facets that say the same in closed form."""

from __future__ import annotations

import cvxpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.capability.joint_capability import fastest_joint_speeds, highest_speeds
from paretoik.errors import SolverFailed
from paretoik.nlp.convex_programs import furthest

seeds = st.integers(0, 10**6)


def drawn(seed, task, dof, parallel=False):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(task, dof))
    if parallel:
        columns = columns[:, :1] * rng.normal(size=dof)
    direction = columns[:, 0] if parallel else rng.normal(size=task)
    return columns, -rng.uniform(0, 2, dof), rng.uniform(0, 2, dof), direction / np.linalg.norm(direction)


@pytest.mark.parametrize("task", [2, 3])
@given(seed=seeds, dof=st.integers(3, 8), parallel=st.booleans())
@settings(max_examples=60)
def test_the_nearest_facet_is_the_optimum_of_the_linear_program(task, seed, dof, parallel):
    columns, low, high, direction = drawn(seed, task, dof, parallel)
    closed = highest_speeds(columns, low, high, direction[None])[0]
    assert closed == pytest.approx(furthest(columns, low, high, direction)[0], rel=1e-12)


@pytest.mark.parametrize("task", [2, 3])
def test_clarabel_by_cvxpy_says_the_same_as_far_as_interior_points_go(task):
    columns, low, high, direction = drawn(5, task, 6)
    x, v = cvxpy.Variable(len(low)), cvxpy.Variable(nonneg=True)
    problem = cvxpy.Problem(cvxpy.Maximize(v), [columns @ x == v * direction, x >= low, x <= high])
    value = problem.solve(solver="CLARABEL")
    assert furthest(columns, low, high, direction)[0] == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize("task", [2, 3])
@given(seed=seeds, dof=st.integers(3, 8))
@settings(max_examples=60)
def test_joint_speeds_of_a_facet_move_the_tool_there_and_keep_their_ranges(task, seed, dof):
    columns, low, high, direction = drawn(seed, task, dof)
    speed, speeds = (each[0] for each in fastest_joint_speeds(columns[None], low[None], high[None], direction[None]))
    assert speed == highest_speeds(columns, low, high, direction[None])[0]
    vertex = direction * speed
    assert np.abs(columns @ speeds - vertex).max() <= 1e-11 * np.abs(columns).sum() * 2
    assert (speeds >= low).all()
    assert (speeds <= high).all()


def test_columns_that_do_not_span_reach_nothing_else():
    columns = np.array([[1.0, 2.0], [0.0, 0.0]])
    one = np.ones(2)
    assert highest_speeds(columns, -one, one, np.eye(2)).tolist() == [3.0, 0.0]
    assert furthest(columns, -one, one, np.array([0.0, 1.0]))[0] == 0.0


def test_what_has_no_end_is_refused():
    with pytest.raises(SolverFailed, match="furthest"):
        furthest(np.eye(2), np.full(2, -1.0), np.full(2, 1.0), np.zeros(2))
