"""Bodies: what is a real one, and how they are combined and transformed."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_massless_bodies_merge_without_dividing_by_zero():
    none = Body(mass=0.0, center=np.zeros(3), inertia=np.zeros((3, 3)))
    assert combine_bodies(none, none).mass == 0.0


def test_the_pseudo_inertia_of_points_is_the_sum_of_their_products():
    rng = np.random.default_rng(1)
    points, masses = rng.normal(size=(5, 3)), rng.uniform(1, 2, 5)
    whole = Body(mass=0.0, center=np.zeros(3), inertia=np.zeros((3, 3)))
    for point, mass in zip(points, masses, strict=True):
        whole = combine_bodies(whole, Body(mass=mass, center=point, inertia=np.zeros((3, 3))))
    ends = np.concatenate([points, np.ones((5, 1))], axis=1)
    np.testing.assert_allclose(whole.pseudo_inertia, (ends.T * masses) @ ends, atol=1e-13)
