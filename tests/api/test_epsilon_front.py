from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from tests.api.problems import tracking


def test_points_are_shown_as_they_come_and_all_are_certified(problem):
    seen = []
    front = pk.epsilon_front(problem, points=5, starts=6, observe=seen.append)
    points = [progress for progress in seen if progress.stage == "point"]
    assert {progress.total for progress in points} == {5}
    assert points[-1].done >= len(front) >= 4
    words = [progress.summary.partition(", ")[2] for progress in points]
    assert list(dict.fromkeys(words)) == ["", "better places sought", "jumps searched"]
    assert all(progress.done == 5 for progress, word in zip(points, words, strict=True) if word)
    assert (seen[-1].stage, seen[-1].done) == ("certification", len(front))
    assert front.certificates.criticality.max() <= 1e-6
    assert front.provenance["settings"] == {
        "points": 5,
        "starts": 6,
        "seed": 0,
        "initial": False,
        "solver": "auto",
        "time_limit": None,
    }


def test_an_epsilon_front_refuses_one_objective():
    with pytest.raises(pk.InvalidInput, match="problem must have two objectives or more for epsilon_front, got one"):
        pk.epsilon_front(tracking(pk.kinetic_energy))


def test_an_end_point_tightened_between_samples_does_not_slide_along_the_front():
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=31)
    limits = pk.Limits(position=np.deg2rad([90, 120, 120]), clearance=0.005)
    cell = {"obstacles": [pk.obstacles.Circle([0.28, -0.11], 0.02)], "link_radius": 0.015, "limits": limits}
    alone = pk.plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], **cell), starts=6)
    both = pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.obstacle_clearance], **cell)
    front = pk.epsilon_front(both, points=3, starts=6)
    lost = front.objectives[0, 0] - alone.best.objective
    assert lost < 1e-4 * np.ptp(front.objectives[:, 0])
