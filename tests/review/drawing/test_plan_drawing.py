"""The texts of a plan."""

from __future__ import annotations

import numpy as np

from paretoik.review.drawing.plan_drawing import optimum_text, plan_end_text
from paretoik.review.recording.messages import (
    PlanEnd,
    PlannedOptimum,
    PlannedScene,
    RecordedMotion,
    RecordedPoint,
    Workcell,
)
from tests.review.conftest import swinging_arm

TIME = np.linspace(0.0, 1.0, 5)
SCENE = PlannedScene(name="energy", unit="J s", maximised=False, workcell=Workcell(arm=swinging_arm(False)))


def optimum(place: int, value: float, branch: str, q: np.ndarray) -> PlannedOptimum:
    point = RecordedPoint(id=place, objectives=np.array([value]), motion=RecordedMotion(time=TIME, q=q))
    return PlannedOptimum(point=point, branch=branch, status="converged", violation_between=0.0)


def test_optima_whose_words_are_the_same_are_distinguished_by_the_joint_that_differs_most():
    q = np.zeros((5, 3))
    turned, slid = q.copy(), q.copy()
    turned[1:3, 1] = -0.25, -0.5
    slid[4, 2] = 0.75  # of the joint that slides
    kinds = [(1.0, "+-", q), (1.0 + 1e-9, "+-", turned), (1.0, "++", turned), (1.0, "+-", slid), (2.0, "+-", turned)]
    optima = [optimum(place, *kind) for place, kind in enumerate(kinds)]
    lines = plan_end_text(SCENE, PlanEnd(optima=optima, provenance={}), 3, 5).splitlines()
    assert "- 0: 1 J s, `+-`" in lines
    assert "- 1: 1 J s, `+-`, joint2 -0.5 rad from optimum 0 at 0.5 s" in lines
    assert "- 2: 1 J s, `++`" in lines
    assert "- 3: 1 J s, `+-`, joint3 +0.75 m from optimum 0 at 1 s" in lines
    assert "- 4: 2 J s, `+-`" in lines
    assert "equal value and branch: joint2 -0.5 rad" in optimum_text(SCENE, optima, 1, 5)
    assert "as good" not in optimum_text(SCENE, optima, 2, 5)


def test_starts_of_the_first_level_and_of_later_levels_are_counted_separately():
    end = PlanEnd(optima=[optimum(0, 1.0, "", np.zeros((5, 3)))], provenance={})
    assert "later levels begin from the optima of the level before, 11 starts in all." in plan_end_text(
        SCENE, end, 156, 167
    )
    assert "The first level had 1 start." in plan_end_text(SCENE, end, 1, 1)
