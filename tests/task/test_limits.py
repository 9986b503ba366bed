"""Limits on joints and users' constraints: all forms, violations, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Arm, Limits, Motion
from paretoik.errors import InvalidInput
from paretoik.task.limits import LIMITED, relative_violation

ARM = Arm.planar(
    lengths=[0.3, 0.25, 0.2],
    masses=[1.0, 0.8, 0.5],
    centers=[0.15, 0.12, 0.1],
    inertias=[0.01, 0.008, 0.004],
    position_limits=([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]),
    velocity_limits=[4.0, np.inf, 6.0],
    torque_limits=[9.0, 8.0, 7.0],
)
SAMPLES = 9
MOTION = Motion(
    arm=ARM,
    time=np.linspace(0, 1, SAMPLES),
    q=np.random.default_rng(0).normal(size=(4, SAMPLES, 3)),
    differences="backward",
)
VARYING = np.linspace(1, 2, SAMPLES)[:, None] * [1.0, 2.0, 3.0]


@pytest.mark.parametrize("kind", LIMITED)
@pytest.mark.parametrize(
    ("given", "lower", "upper"),
    [
        (2.0, [[-2, -2, -2]], [[2, 2, 2]]),
        ([1.0, 2.0, 3.0], [[-1, -2, -3]], [[1, 2, 3]]),
        ((-np.inf, [1.0, 2.0, 3.0]), [[-np.inf] * 3], [[1, 2, 3]]),
        (VARYING, -VARYING, VARYING),
        ((-1.0, VARYING), np.full((SAMPLES, 3), -1.0), VARYING),
    ],
    ids=["number", "list", "one-sided", "(time, dof)", "pair with (time, dof)"],
)
def test_limits_may_be_given_in_many_ways(kind, given, lower, upper):
    bounds = Limits(**{kind: given}).bounds(ARM, SAMPLES)[kind]
    np.testing.assert_array_equal(bounds[..., 0], lower)
    np.testing.assert_array_equal(bounds[..., 1], upper)


def test_none_is_the_arms_own_limit_and_infinity_is_none():
    own = Limits().bounds(ARM, SAMPLES)
    assert set(own) == {"position", "velocity", "torque"}
    np.testing.assert_array_equal(own["position"][0], ARM.position_limits)
    np.testing.assert_array_equal(own["velocity"][0], [[-4, 4], [-np.inf, np.inf], [-6, 6]])
    np.testing.assert_array_equal(own["torque"][0, :, 1], [9, 8, 7])
    assert Limits(position=np.inf, velocity=np.inf, torque=np.inf).bounds(ARM, SAMPLES) == {}


def test_a_mapping_goes_by_name_and_leaves_the_others_their_own():
    bounds = Limits(velocity={"joint2": 5.0, "joint1": (-1.0, 2.0)}, position={"joint3": np.inf}).bounds(ARM, SAMPLES)
    np.testing.assert_array_equal(bounds["velocity"][0], [[-1, 2], [-5, 5], [-6, 6]])
    np.testing.assert_array_equal(bounds["position"][0], [[-1, 1], [-2, 2], [-np.inf, np.inf]])
    backwards = Limits(velocity={"joint1": (-1.0, 2.0), "joint2": 5.0}).bounds(ARM, SAMPLES)
    np.testing.assert_array_equal(bounds["velocity"], backwards["velocity"])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"position": (2.0, 1.0)}, r"position limit of joint1 must be lower ≤ upper, got 2\.0 and 1\.0"),
        (
            {"power": [1.0, 2.0]},
            r"power limit must be one number, 3 \(one per joint\) or an array \(9, 3\), got shape \(2,\)",
        ),
        (
            {"velocity": {"elbow": 1.0}},
            "velocity limit must name joints among joint1, joint2, joint3, got 'elbow'",
        ),
        ({"velocity": {"joint2": (3.0, 1.0)}}, "velocity limit of joint2 must be lower ≤ upper"),
    ],
)
def test_what_is_no_limit_is_refused_with_its_kind_and_joint(given, words):
    with pytest.raises(InvalidInput, match=words) as refused:
        Limits(**given).bounds(ARM, SAMPLES)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", LIMITED)
@pytest.mark.parametrize("given", [2.0, (-0.5, 3.0), VARYING], ids=["number", "pair", "varying"])
def test_violations_are_shares_of_the_range_and_positive_only_beyond(kind, given):
    bounds = Limits(**{kind: given}).bounds(ARM, SAMPLES)[kind]
    values = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "torque", "power": "power"}[kind]
    result, beyond = relative_violation(kind, bounds, MOTION), 0
    for place in np.ndindex(MOTION.q.shape):
        value = getattr(MOTION, values)[place]
        lower, upper = bounds[place[1] if len(bounds) > 1 else 0, place[2]]
        expected = max(value - upper, lower - value) / (upper - lower)
        assert result[place] == pytest.approx(expected, rel=1e-12)
        assert (result[place] > 0) == (not lower <= value <= upper)
        beyond += result[place] > 0
    assert 0 < beyond < result.size


def test_one_sided_limits_are_scaled_by_their_size_and_zero_ones_by_one():
    for upper, scale in ((4.0, 4.0), (0.0, 1.0), (-2.0, 2.0)):
        bounds = Limits(position=(-np.inf, upper)).bounds(ARM, SAMPLES)["position"]
        np.testing.assert_allclose(
            relative_violation("position", bounds, MOTION), (MOTION.q - upper) / scale, rtol=1e-12
        )
    bounds = Limits(position=(2.0, np.inf)).bounds(ARM, SAMPLES)["position"]
    np.testing.assert_allclose(relative_violation("position", bounds, MOTION), (2.0 - MOTION.q) / 2.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("form", "lower", "upper", "scale", "expected"),
    [
        ("peak", -np.inf, 1.0, 1.0, lambda v: (v - 1).max(axis=1)),
        ("peak", 0.5, np.inf, 0.5, lambda v: (0.5 - v).max(axis=1)),
        ("peak", -1.0, 3.0, 4.0, lambda v: np.maximum(v - 3, -1 - v).max(axis=1)),
        ("peak", 0.0, np.inf, 1.0, lambda v: -v.min(axis=1)),
        ("integral", -np.inf, 2.0, 2.0, lambda v: v[:, 1:].sum(axis=1) / 8 - 2),
        ("terminal", -np.inf, -3.0, 3.0, lambda v: v[:, -1] + 3),
        ("general", 1.0, 1.0, 1.0, lambda v: np.abs(v[:, -1] - 1)),
    ],
)
def test_a_users_constraint_is_counted_like_a_limit(form, lower, upper, scale, expected):
    @pk.constraint(unit="rad", form=form, lower=lower, upper=upper)
    def own(motion):
        values = motion.q[..., 0]
        return values if form in ("integral", "peak") else values[..., -1]

    assert own.scale == scale
    np.testing.assert_allclose(own.violation(MOTION), expected(MOTION.q[..., 0]) / scale, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(own.violation(MOTION[2]), own.violation(MOTION)[2], rtol=1e-12)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "at least one finite bound and lower ≤ upper, got -inf and inf"),
        ({"upper": 1.0, "scale": 0.0}, r"scale: must be positive, got 0"),
    ],
)
def test_what_bounds_nothing_is_refused(settings, words, unchecked):
    with pytest.raises(InvalidInput, match=words):
        pk.constraint(unit="", **settings)


def test_a_margin_moves_every_joint_limit_inwards_by_a_share_of_its_range():
    arm = pk.arms.tringali_3r()
    bounds = pk.Limits(position=([-1.0, -2.0, -3.0], [1.0, 2.0, np.inf]), velocity=4.0, margin=0.1).bounds(arm, 5)
    assert bounds["position"][0] == pytest.approx(np.array([[-0.8, 0.8], [-1.6, 1.6], [-2.7, np.inf]]))
    assert bounds["velocity"][0] == pytest.approx(np.tile([-3.2, 3.2], (3, 1)))


@pytest.mark.parametrize("position", [[90, 120, 120], {"joint2": 120}])
def test_position_limits_in_degrees_are_a_warning_that_says_what_makes_radians(position):
    with pytest.warns(
        RuntimeWarning, match=r"position limit of joint\d: .* turns; if it is in degrees, convert it by np.deg2rad"
    ):
        pk.Limits(position=position).bounds(pk.arms.tringali_3r(), 11)
