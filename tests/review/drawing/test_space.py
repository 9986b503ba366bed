"""The eye sees a whole scene, as large as its view allows."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.review.drawing.space import fitting_eye, half_view


def seen_at(points: np.ndarray) -> np.ndarray:
    """Return where a separate pinhole camera sees points, as shares of half the usable view."""
    eye = fitting_eye(points)
    position, target = (np.array(each.as_arrow_array().to_pylist()[0]) for each in (eye.position, eye.look_target))
    away = (target - position) / np.linalg.norm(target - position)
    right = np.cross(away, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    rays = points - position
    assert (rays @ away > 0).all()
    return np.stack([rays @ right, rays @ np.cross(right, away)], axis=1) / (rays @ away)[:, None] / half_view()


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (0.2, 0.2, 2.0), (3.0, 0.1, 0.2), (0.1, 3.0, 0.2)])
def test_all_points_are_in_sight_and_fill_the_view_one_way(size, sides):
    rng = np.random.default_rng(0)
    points = size * (np.array(sides) * rng.random((200, 3)) + [0.5, -2.0, 0.3])
    shares = seen_at(points)
    assert np.abs(shares).max() <= 1.0 + 1e-5  # a viewer has single precision
    assert np.ptp(shares, axis=0).max() >= 2.0 - 1e-5
