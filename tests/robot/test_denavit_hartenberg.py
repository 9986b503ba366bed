"""Both conventions of Denavit–Hartenberg tables against products of their matrices."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from tests.robot.laws import same
from tests.robot.oracles import potential_energy


@pytest.mark.parametrize("convention", ["modified", "standard"])
@pytest.mark.parametrize("seed", range(2))
def test_dh_poses_are_products_of_the_conventions_matrices(dh_table, convention, seed):
    table = dh_table(seed)
    arm = Arm.from_dh(**table, convention=convention)
    for q in np.random.default_rng(seed).normal(size=(3, arm.dof)):
        product = _link_frame(table, q, arm.dof - 1, convention)
        rotation, position = kinematics.forward_kinematics(arm, q)
        same(rotation, product[:3, :3], 1e-14)
        same(position, product[:3, 3], 1e-14)


def _link_frame(table, q, last, convention):
    """Return the frame of a link as the product of the table's matrices up to its row."""
    product = np.eye(4)
    for i in range(last + 1):
        slide = table["types"][i] == "prismatic"
        theta, d = table["theta"][i] + (0 if slide else q[i]), table["d"][i] + (q[i] if slide else 0)
        about_z = _turn_z(theta) @ _shift(0, d)
        about_x = _turn_x(table["alpha"][i]) @ _shift(table["a"][i], 0)
        product = product @ (about_x @ about_z if convention == "modified" else about_z @ about_x)
    return product


def _turn_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def _turn_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def _shift(x, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, 0, z
    return matrix


@pytest.mark.parametrize("convention", ["modified", "standard"])
def test_dh_bodies_stand_in_their_own_link_frames(dh_table, convention):
    table = dh_table(3)
    arm = Arm.from_dh(**table, convention=convention)
    q = np.full(arm.dof, 0.3)
    frames = [_link_frame(table, q, i, convention) for i in range(arm.dof)]
    height = sum(
        mass * (frame[:3, :3] @ center + frame[:3, 3])[2]
        for mass, center, frame in zip(table["masses"], table["centers"], frames, strict=True)
    )
    same(potential_energy(arm, q), np.array(9.81 * height))
