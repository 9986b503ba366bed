"""Bodies: checks of real ones, combination and transformation."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.arms import tringali_3r
from paretoik.robot.body import Body, combine_bodies, inertia_fault, nearest_inertia, transform_body
from paretoik.robot.pose import Pose


@pytest.mark.parametrize(
    ("inertia", "words"),
    [
        (np.diag([1.0, 2.0, 2.5]), None),
        (np.diag([1.0, 1.0, 2.0]), None),
        (np.diag([1e-25, 1e-25, 1e-20]), None),
        (np.diag([-1.0, 2.0, 2.0]), "positive"),
        (np.diag([1.0, 1.0, 2.1]), "triangle"),
        (np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "symmetric"),
    ],
)
def test_only_the_inertia_of_a_real_body_passes(inertia, words):
    fault = inertia_fault(inertia)
    assert fault is None if words is None else words in fault


def test_the_nearest_inertia_is_real_leaves_a_real_one_and_no_other_real_one_is_nearer():
    rng = np.random.default_rng(2)

    def moments(inertia):
        return np.trace(inertia) / 2 * np.eye(3) - inertia

    for _ in range(50):
        matrix = rng.normal(size=(3, 3))
        wrong = matrix + matrix.T
        nearest = nearest_inertia(wrong)
        assert inertia_fault(nearest) is None
        np.testing.assert_allclose(nearest_inertia(nearest), nearest, atol=1e-12)
        distance = np.linalg.norm(moments(nearest) - moments(wrong))
        points = nearest_inertia(nearest + rng.normal(scale=0.1, size=(20, 3, 3)).mean(axis=0))
        assert np.linalg.norm(moments(points) - moments(wrong)) >= distance - 1e-12


def test_two_bodies_merged_in_any_order_or_frame_are_one():
    rng = np.random.default_rng(0)
    first, second = (Body(mass=m, center=rng.normal(size=3), inertia=np.diag([1.0, 2.0, 2.5])) for m in (1.0, 2.0))
    pose = Pose(rng.normal(size=3), np.array([0.5, 0.5, -0.5, 0.5]))
    whole = transform_body(combine_bodies(first, second), pose)
    other = combine_bodies(transform_body(second, pose), transform_body(first, pose))
    assert whole.pseudo_inertia == pytest.approx(other.pseudo_inertia, abs=1e-13)
    assert whole.mass == 3.0


# Arguments of arms: limits in every form, and refusals


DH = {"a": [0.1, 0.2], "alpha": [0.0, 1.0], "d": [0.0, 0.1], "theta": [0.0, 0.0], "convention": "modified"}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Arm.planar(lengths=[1.0, 0.0]), "lengths must be positive"),
        (lambda: Arm.planar(lengths=[1.0], position_limits=(1.0, -1.0)), "position_limits of joint 1 must be lower"),
        (lambda: Arm.from_dh(**{**DH, "convention": "craig"}), "convention must be"),
        (lambda: Arm.from_dh(**{**DH, "a": [0.1]}), "a, alpha, d and theta must .* per joint, got 1, 2, 2, 2 values"),
        (lambda: Arm.from_dh(**DH, types=["revolute", "planar"]), "types must be one of"),
        (lambda: Arm.from_dh(**DH, masses=[1.0, 1.0], centers=np.zeros((1, 3))), "inertias must have shapes"),
        (lambda: tringali_3r().fixed(joint1=0, joint2=0, joint3=0), "must be one of several moving joints, got the"),
        (lambda: tringali_3r().with_payload(1.0, inertia=np.diag([1.0, 1.0, 3.0])), "triangle inequality"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_name_and_value(make, words):
    with pytest.raises(InvalidInput, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
