"""Highest speeds and torques of joints with their sliders at the best places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from paretoik.capability.actuation import kim_sliders
from paretoik.capability.joint_capability import (
    greatest_forces,
    highest_speeds,
    joint_speeds,
    torque_capacity,
)


def test_a_joint_beyond_what_its_rod_reaches_cannot_hold():
    actuation = kim_sliders()
    for angle in (0.0, 0.1, np.deg2rad(117.5), -0.5):
        q = actuation.zero + np.full(3, angle)
        assert np.isnan(joint_speeds(actuation, q, np.zeros(3)).high).all()
        assert np.isnan(torque_capacity(actuation, q)[0]).all()
    turned = actuation.zero + 1.0
    again = joint_speeds(actuation, turned + 2 * np.pi, np.zeros(3)).high
    assert np.allclose(again, joint_speeds(actuation, turned, np.zeros(3)).high)


# The nearest facet of a zonotope compared with linear programs over the same joints.


def cases(task, dof, count=12):
    rng = np.random.default_rng(10 * task + dof)
    for _ in range(count):
        columns, direction = rng.normal(size=(task, dof)), rng.normal(size=task)
        yield columns, -rng.uniform(0.1, 2.0, dof), rng.uniform(0.1, 2.0, dof), direction / np.linalg.norm(direction)


@pytest.mark.parametrize(("task", "dof"), [(2, 2), (2, 5)])
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
