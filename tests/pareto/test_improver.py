"""Points that help a search: better than where they came from, at its ends, in gaps and in every branch."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.pareto.improver import OPTIONS, Improver
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
    improver = Improver(program(), lambda points: ["one"] * len(points))
    suggested = improver.suggest(x, F)
    values = np.stack([(suggested[:, :2] ** 2).sum(axis=1), ((suggested[:, :2] - [1, 0]) ** 2).sum(axis=1)], axis=1)
    assert len(values) >= 3
    assert (values.min(axis=0) < 0.5 * F.min(axis=0)).all()
    assert np.abs(suggested[:, 1]).min() < 0.5 * 0.2
    assert improver.spent > 0


def test_every_branch_is_aimed_at():
    x, F = near_the_front(6)
    x[3:, 1] *= -1
    improver = Improver(program(), lambda points: ["above" if y > 0 else "below" for y in points[:, 1]])
    suggested = improver.suggest(x, F)
    assert len(suggested) == len(Improver(program(), lambda points: ["one"] * len(points)).suggest(x, F)) + 1


def test_it_is_due_every_few_generations_while_iterations_are_left():
    improver = Improver(program(), lambda points: ["one"] * len(points))
    assert [k for k in range(1, 31) if improver.is_due(k, 1000)] == [10, 20, 30]
    improver.spent = 301
    assert OPTIONS.share == pytest.approx(0.3)
    assert not improver.is_due(10, 1000)
    assert improver.is_due(10, 1004)
