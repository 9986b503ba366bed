"""The search compared with the stored reference."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.front.indicators import hypervolume
from studies.benchmarks import energy_torque as study


def staircase(F, reference):
    """Return the area between a front of two objectives and a reference beyond it, rectangle by rectangle."""
    F = F[np.argsort(F[:, 0])]
    right = np.append(F[1:, 0], reference[0])
    return float(np.sum((right - F[:, 0]) * (reference[1] - F[:, 1])))


def test_no_point_of_the_stored_reference_dominates_another():
    F = study.reference_front()
    no_worse = np.all(F[:, None] <= F[None], axis=-1)
    assert np.array_equal(no_worse, np.eye(len(F), dtype=bool))


def test_every_goal_of_the_search_can_be_counted_below_the_reference_point():
    F = study.reference_front()
    assert len(F) >= study.POINTS_GOAL
    assert F[:, 1].min() < study.REFERENCE_POINT[1]
    assert F[:, 0].min() < study.REFERENCE_POINT[0]


def test_the_reference_is_what_its_staircase_covers():
    F = study.reference_front()
    below = F[np.less(F, study.REFERENCE_POINT).all(axis=1)]
    assert hypervolume(F, study.REFERENCE_POINT) == pytest.approx(staircase(below, study.REFERENCE_POINT), rel=1e-12)
