"""Highest speeds and torques of joints with their sliders at the best places."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from paretoik.capability.actuation import SHAPES, kim_joint_motors, kim_sliders
from paretoik.capability.joint_capability import (
    greatest_forces,
    highest_speeds,
    joint_speeds,
    overload_error,
    torque_capacity,
)
from paretoik.robot.arms import kim_3r
from tests.capability.drives import sliders

seeds = st.integers(0, 10**6)


shapes = st.sampled_from(SHAPES)


@given(seed=seeds, shape=shapes)
@settings(max_examples=25)
def test_the_best_slider_gives_its_stated_speed(seed, shape):
    rng = np.random.default_rng(seed)
    actuation = sliders(shape, bend=-1.0)
    q = actuation.zero - rng.uniform(0.2, 2.0, (8, 2))
    torque = rng.normal(size=(8, 2))
    speed_ranges = joint_speeds(actuation, q, torque)
    can = ~np.isnan(speed_ranges.high)
    back, a, b = actuation.gears(q, np.where(can, speed_ranges.front_high, 0.05))
    speeds = [np.where(g > 0, *reversed(c.speeds(g * torque))) for g, c in ((a, actuation.front), (b, actuation.back))]
    assert np.allclose((a * speeds[0] + b * speeds[1])[can], speed_ranges.high[can], rtol=1e-12)
    assert (back[can] >= actuation.back_bounds[0, 0] - 1e-12).all()
    assert (back[can] <= actuation.back_bounds[0, 1] + 1e-12).all()


def test_sliders_hold_exactly_what_they_can_bear():
    actuation = kim_sliders()
    q = actuation.zero + np.array([0.9, 1.2, 1.9])
    able, _ = torque_capacity(actuation, q)
    assert np.isfinite(joint_speeds(actuation, q, 0.999999 * able).high).all()
    assert np.isnan(joint_speeds(actuation, q, 1.000001 * able).high).all()


def test_a_joint_beyond_what_its_rod_reaches_cannot_hold():
    actuation = kim_sliders()
    for angle in (0.0, 0.1, np.deg2rad(117.5), -0.5):
        q = actuation.zero + np.full(3, angle)
        assert np.isnan(joint_speeds(actuation, q, np.zeros(3)).high).all()
        assert np.isnan(torque_capacity(actuation, q)[0]).all()
    turned = actuation.zero + 1.0
    again = joint_speeds(actuation, turned + 2 * np.pi, np.zeros(3)).high
    assert np.allclose(again, joint_speeds(actuation, turned, np.zeros(3)).high)


def test_an_overload_names_joint_torque_and_limit():
    arm = kim_3r()
    refusal = overload_error(kim_joint_motors(), arm, np.zeros(3), np.array([1.0, 4.0, 0.1]))
    assert "joint2 must bear a torque of at most 3.5 N m" in str(refusal)
    assert refusal.violation == pytest.approx(4.0 / 3.5 - 1)
    assert "joint1 must have a rod's angle" in str(overload_error(kim_sliders(), arm, np.full(3, 3.0), np.zeros(3)))


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


def test_parallel_columns_move_the_tool_along_a_line_only():
    columns = np.array([[1.0, 2.0], [1.0, 2.0]])
    along, across = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2)
    low, high = -np.ones(2), np.ones(2)
    np.testing.assert_allclose(highest_speeds(columns, low, high, along[None]), 3 * np.sqrt(2))
    np.testing.assert_allclose(highest_speeds(columns, low, high, across[None]), 0.0, atol=1e-12)
