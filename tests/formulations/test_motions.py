"""Motions between neighbours of fronts: jumps of fronts of real problems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.formulations.motions import values_between
from paretoik.trajectory.motion_terms import joint_distance
from problems import tringali_2020


@pytest.fixture(scope="module")
def problem():
    objectives = [pk.kinetic_energy, pk.torque_norm]
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    path = tringali_2020.straight(51)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, limits=limits, differences="backward")


@pytest.fixture(scope="module")
def front(problem):
    return pk.epsilon_front(problem, points=10, starts=8)


def test_whole_turns_of_a_joint_are_left_out_between_motions(problem, front):
    q = np.repeat(np.array(front.motions.q[:1]), 2, axis=0)
    q[1, :, 1] += 2 * np.pi
    values = values_between(problem.task, q, np.array([0.5]))
    np.testing.assert_allclose(values[0, 0], front.minimised[0], rtol=1e-9)


def test_no_motion_is_between_an_elbow_up_and_an_elbow_down(problem, front):
    q = np.array(front.motions.q[:1])
    mirrored = q.copy()  # on the other side of the line from base to tool
    direction = np.arctan2(*problem.task.motion(q).tool[0, :, ::-1].T)
    mirrored[0, :, 0] = 2 * direction - q[0, :, 0]
    mirrored[0, :, 1:] = -q[0, :, 1:]
    assert np.abs(problem.task.motion(mirrored).tracking_error).max() < 1e-9
    assert (values_between(problem.task, np.concatenate([q, mirrored]), np.array([0.5])) > front.minimised[0]).any()


def test_motions_through_an_obstacle_are_impossible(problem, front):
    q = np.array(front.motions.q[[0, 0]])
    elbow = problem.task.motion(q[0]).links[20, 2, :2]
    blocked = replace(problem.task, obstacles=(pk.obstacles.Circle(center=elbow, radius=0.02),))
    assert np.isinf(values_between(blocked, q, np.array([0.5]))).all()


def test_the_trade_off_of_kinetic_energy_and_torque_jumps_once_where_motions_are_far_apart(problem, front):
    ((one, other),) = front.jumps
    row = front.ids.tolist().index(one)
    assert front.ids[row + 1] == other
    q = np.array(front.motions.q)
    distances = joint_distance(problem.task, q[1:], q[:-1])
    assert row == distances.argmax()
    assert distances[row] > 2 * np.delete(distances, row).max()
