"""Models of speeds along paths: times of pieces to first order, boxes, and what is no model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from paretoik.capability.geodesic import check_ends, check_model, evaluate_roots, is_outside, linearise_pieces
from paretoik.errors import InvalidInput
from tests.capability.fields import TASKS, field


def path_in(model, count, seed=0):
    rng = np.random.default_rng(seed)
    return model.lower + rng.uniform(0.2, 0.8, size=(count, len(model.lower))) * (model.upper - model.lower)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("size", TASKS)
def test_pieces_are_the_models_and_their_derivatives_those_of_differences(size, share):
    model = field(size)
    points = path_in(model, 6)
    pieces = linearise_pieces(model, points, share)
    change = np.diff(points, axis=0)
    roots = model.roots(points[:-1] + share * change)[0]
    np.testing.assert_allclose(pieces.values, np.einsum("lij,lj->li", roots, change), rtol=1e-13)
    step = 1e-6
    for axis in range(size):
        ahead, behind = (linearise_pieces(model, points + sign * step * np.eye(size)[axis], share) for sign in (1, -1))
        together = (ahead.values - behind.values) / (2 * step)  # all points move: the sum of both derivatives
        np.testing.assert_allclose((pieces.before + pieces.after)[..., axis], together, atol=1e-6)
        for k in range(len(points)):
            moved = points.copy()
            moved[k, axis] += step
            slope = (linearise_pieces(model, moved, share).values - pieces.values) / step
            expected = np.zeros_like(slope)
            if k < len(slope):
                expected[k] = pieces.before[k, :, axis]
            if k:
                expected[k - 1] = pieces.after[k - 1, :, axis]
            np.testing.assert_allclose(slope, expected, atol=1e-3)


def test_a_box_is_left_by_more_than_rounding_alone():
    model = field(2)
    corner, width = model.upper, model.upper - model.lower
    assert not is_outside(model, corner + 0.9e-9 * width).any()
    np.testing.assert_array_equal(is_outside(model, corner + [0.0, 2e-9] * width), [False, True])
    assert is_outside(model, np.array([np.nan, corner[1]])).tolist() == [True, False]
    start, target = check_ends(model, model.lower.tolist(), model.upper)
    np.testing.assert_array_equal([start, target], [model.lower, model.upper])
    with pytest.raises(InvalidInput, match="target: coordinate 1 must be in the model's box"):
        check_ends(model, model.lower, corner + np.array([0.0, 0.1]))


def test_what_is_no_model_or_has_no_number_is_refused():
    with pytest.raises(InvalidInput, match="model: a model of speeds wanted"):
        check_model(7)
    points = np.zeros((3, 2))
    roots = np.ones((3, 2, 2))
    roots[1] = np.inf
    broken = SimpleNamespace(lower=np.zeros(2), upper=np.ones(2), roots=lambda at: (roots, np.zeros((3, 2, 2, 2))))
    with pytest.raises(InvalidInput, match=r"finite R and ∂R/∂p wanted, got others at \[0 0\] m"):
        evaluate_roots(broken, points)
