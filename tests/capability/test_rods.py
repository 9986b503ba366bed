"""Angles that rods reach beside all pairs of their sliders, and geometry that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.capability.actuation import angle_range, broadcast, check_geometry
from paretoik.errors import InvalidInput


def test_a_rods_angles_are_those_of_all_pairs_of_sliders():
    rng, reached, refused = np.random.default_rng(1), 0, 0
    for _ in range(200):
        rod, margin = rng.uniform(0.05, 0.2), rng.uniform(0.02, 0.3)
        first, second = rod * rng.uniform(0.1, 0.8), rod * rng.uniform(0.1, 1.5)
        bounds = (
            np.array([first, min(rod, first * rng.uniform(1.02, 3.0))]),
            second * np.array([1, rng.uniform(1.02, 3)]),
        )
        front, back = (np.linspace(*pair, 301) for pair in bounds)
        cosine = (rod**2 - front[:, None] ** 2 - back**2) / (2 * front[:, None] * back)
        angles = np.arccos(cosine[np.abs(cosine) <= 1.0])
        inside = angles[(angles >= margin) & (angles <= np.pi - margin)]
        if not len(inside):
            refused += 1
            with pytest.raises(InvalidInput, match="sliders that reach a rod's angle"):
                angle_range(rod, *bounds, margin)
            continue
        reached += 1
        low, high = angle_range(rod, *bounds, margin)
        assert low <= inside.min() + 1e-9
        assert high >= inside.max() - 1e-9
        assert low == pytest.approx(max(angles.min(), margin), abs=0.02)
        assert high == pytest.approx(min(angles.max(), np.pi - margin), abs=0.02)
    assert reached > 100
    assert refused > 5


def test_a_number_is_every_joints_and_may_not_be_written():
    bounds = broadcast("front_bounds", (0.1, 0.2), (3, 2))
    np.testing.assert_array_equal(bounds, [[0.1, 0.2]] * 3)
    assert not bounds.flags.writeable
    with pytest.raises(InvalidInput, match=r"distributed actuation: rod wants shape \(3,\), got \(2,\)"):
        broadcast("rod", [0.1, 0.2], (3,))


GEOMETRY = {
    "rod": np.array([0.08, 0.09]),
    "zero": np.zeros(2),
    "bend": np.array([1.0, -1.0]),
    "least_angle": np.array([0.1, 0.2]),
    "front_bounds": np.array([[0.03, 0.08], [0.03, 0.09]]),
    "back_bounds": np.array([[0.03, 0.2], [0.03, 0.2]]),
}


@pytest.mark.parametrize(
    ("name", "value", "wish"),
    [
        ("rod", 0.0, r"a rod longer than 0 and of at most \S+ m"),
        ("bend", 0.5, "bend 1 or −1"),
        ("least_angle", np.pi, "a least angle between 0 and π"),
        ("front_bounds", [0.05, 0.04], "front bounds 0 < lower ≤ upper"),
        ("front_bounds", [0.05, 0.0901], "front sliders no farther than the rod is long"),
        ("back_bounds", [0.0, 0.04], "back bounds 0 < lower ≤ upper"),
    ],
)
def test_geometry_that_cannot_be_is_refused_with_its_joint(name, value, wish):
    check_geometry(**GEOMETRY)
    wrong = GEOMETRY[name].copy()
    wrong[1] = value
    with pytest.raises(InvalidInput, match=f"joint 2: {wish} wanted"):
        check_geometry(**{**GEOMETRY, name: wrong})
