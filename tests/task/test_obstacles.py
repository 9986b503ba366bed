"""Obstacles: frozen shapes, and what is none."""

from __future__ import annotations

import re

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose
from paretoik.task.obstacles import Box, Capsule, Circle, Sphere


def test_obstacles_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Sphere([0.3, -0.2, 0.1], 0.4).center[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        Box([0.1, 0.2, -0.1], [0.3, 0.2, 0.5]).half_sizes[0] = 1.0
    with pytest.raises(AttributeError):
        Circle([0.0, 0.0], 0.1).radius = 1.0


def test_a_box_stands_at_its_point_or_pose():
    assert Box([0.1, 0.2], [0.3, 0.2]).pose.position.tolist() == [0.1, 0.2, 0.0]
    pose = Pose.planar(0.1, -0.2, 0.7)
    assert Box(pose, [0.3, 0.2]).pose is pose


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Circle([0, 0], -0.1), "circle radius: must be positive, got -0.1 m"),
        (lambda: Circle([0, 0, 0], 0.1), "circle center: must have shape (2,), got shape (3,)"),
        (lambda: Sphere([0, 0, 0], np.nan), "sphere radius: must be finite, got nan"),
        (lambda: Sphere([0, np.inf, 0], 0.1), "sphere center: must be finite, got inf at index 1"),
        (lambda: Capsule([0, 0, 0], [1, 0, 0], 0.0), "capsule radius: must be positive, got 0 m"),
        (lambda: Capsule([0, 0], [1, 0], 0.1), "capsule start: must have shape (3,), got shape (2,)"),
        (lambda: Box([0, 0, 0], [0.1, -0.2, 0.3]), "box half_sizes: must be positive, got -0.2 m at index 1"),
        (lambda: Box([0, 0, 0], 0.1), "box half_sizes: must be 2 or 3, got shape ()"),
        (lambda: Box([0, 0], [0.1, 0.2, 0.3]), "box center: must have shape (3,), got shape (2,)"),
    ],
)
def test_what_is_no_obstacle_is_refused_with_name_wish_and_fact(make, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()
