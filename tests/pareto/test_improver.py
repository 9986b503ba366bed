"""Points that help a search: better than where they came from, at its ends, in gaps and in every branch."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.pareto.refine import suggest_points
from tests.pareto.sketches import sketched


def program():
    """Squared distances to (0, 0) and (1, 0): the front is the line between them."""
    return sketched(2, lambda x: [x[0] ** 2 + x[1] ** 2, (x[0] - 1) ** 2 + x[1] ** 2])


def near_the_front(count, height=0.2):
    """Points above the line, and their objectives."""
    places = np.stack([np.linspace(0.2, 0.8, count), np.full(count, height)], axis=1)
    F = np.stack([(places**2).sum(axis=1), ((places - [1, 0]) ** 2).sum(axis=1)], axis=1)
    return np.concatenate([places, F], axis=1), F


@pytest.mark.parametrize("count", [2, 5])
def test_points_come_nearer_to_the_front_and_its_ends_move_out(count):
    x, F = near_the_front(count)
    suggested, iterations = suggest_points(program(), x, F, ["one"] * count)
    values = np.stack([(suggested[:, :2] ** 2).sum(axis=1), ((suggested[:, :2] - [1, 0]) ** 2).sum(axis=1)], axis=1)
    assert len(values) >= 3
    assert (values.min(axis=0) < 0.5 * F.min(axis=0)).all()
    assert np.abs(suggested[:, 1]).min() < 0.5 * 0.2
    assert 0 < iterations <= 5 * (len(suggested) + 1)


def test_every_branch_is_aimed_at():
    x, F = near_the_front(6)
    x[3:, 1] *= -1
    both, _ = suggest_points(program(), x, F, ["above" if y > 0 else "below" for y in x[:, 1]])
    alone, _ = suggest_points(program(), x, F, ["one"] * 6)
    assert len(both) == len(alone) + 1
