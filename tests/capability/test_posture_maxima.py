"""The nearest facet of a zonotope against linear programs over the same joints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from paretoik.capability.joint_capability import greatest_forces, highest_speeds


def cases(task, dof, count=12):
    rng = np.random.default_rng(10 * task + dof)
    for _ in range(count):
        columns, direction = rng.normal(size=(task, dof)), rng.normal(size=task)
        yield columns, -rng.uniform(0.1, 2.0, dof), rng.uniform(0.1, 2.0, dof), direction / np.linalg.norm(direction)


@pytest.mark.parametrize(("task", "dof"), [(2, 2), (2, 3), (2, 5), (3, 3), (3, 4), (3, 7)])
def test_the_highest_speed_is_that_of_a_linear_program(task, dof):
    for columns, low, high, direction in cases(task, dof):
        ours = highest_speeds(columns, low, high, direction[None])[0]
        table = np.hstack([columns, -direction[:, None]])
        best = linprog(
            [*np.zeros(dof), -1.0], A_eq=table, b_eq=np.zeros(task), bounds=[*zip(low, high, strict=True), (0, None)]
        )
        assert ours == pytest.approx(-best.fun, rel=1e-9)


@pytest.mark.parametrize(("task", "dof"), [(2, 2), (2, 5), (3, 7)])
def test_the_greatest_force_just_reaches_the_torque_of_some_joint(task, dof):
    for columns, low, high, direction in cases(task, dof):
        force = greatest_forces(columns, low, high, direction[None])[0]
        torque = columns.T @ (force * direction)
        assert (torque >= low - 1e-9).all()
        assert (torque <= high + 1e-9).all()
        assert np.minimum(torque - low, high - torque).min() == pytest.approx(0.0, abs=1e-9)


def test_columns_that_are_parallel_move_the_tool_along_a_line_alone():
    columns = np.array([[1.0, 2.0], [1.0, 2.0]])
    along, across = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2)
    low, high = -np.ones(2), np.ones(2)
    np.testing.assert_allclose(highest_speeds(columns, low, high, along[None]), 3 * np.sqrt(2))
    np.testing.assert_allclose(highest_speeds(columns, low, high, across[None]), 0.0, atol=1e-12)


def test_no_joint_bears_a_force_that_no_column_sees():
    columns = np.array([[1.0, 2.0], [0.0, 0.0]])
    forces = greatest_forces(columns, -np.ones(2), np.ones(2), np.eye(2))
    np.testing.assert_allclose(forces, [0.5, np.inf])


def test_joints_whose_speeds_are_unknown_give_no_speed():
    low = np.array([[-1.0, np.nan], [-1.0, -1.0]])
    speeds = highest_speeds(np.stack([np.eye(2)] * 2), low, np.ones((2, 2)), np.eye(2))
    assert np.isnan(speeds[0]).all()
    np.testing.assert_allclose(speeds[1], 1.0)
