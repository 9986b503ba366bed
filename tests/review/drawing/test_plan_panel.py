"""The panel of a plan: marks of a level keep off the borders of its band."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.plan_panel import PlanPanel
from paretoik.review.drawing.scatter import LAYERS
from paretoik.review.recording.messages import (
    PlannedLevel,
    PlannedMotions,
    PlannedOptimum,
    PlannedScene,
    RecordedPoint,
    Workcell,
)
from tests.review.conftest import swinging_arm

SCENE = PlannedScene(name="energy", unit="J s", maximised=False, workcell=Workcell(arm=swinging_arm(False)))
LARGEST = LAYERS["chosen"][1]  # of the mark of the best


def level(number: int, count: int) -> PlannedLevel:
    q, optimum = np.zeros((count, 2, 3)), np.zeros(count, dtype=np.int64)
    motions = PlannedMotions(time=np.array([0.0, 1.0]), starts=q, ends=q, optima=q[:1], optimum=optimum)
    starts, ends = np.linspace(2.0, 3.0, count), np.ones(count)
    return PlannedLevel(number=number, samples=11, starts=starts, ends=ends, optima=ends[:1], motions=motions)


def optimum(place: int) -> PlannedOptimum:
    point = RecordedPoint(id=place, objectives=np.array([1.0 + place]), motion=None)
    return PlannedOptimum(point=point, branch="", status="converged", violation_between=0.0)


def panel(counts: list[int], optima: int) -> PlanPanel:
    levels = [level(number, count) for number, count in enumerate(counts)]
    return PlanPanel(scene=SCENE, levels=levels, optima=[optimum(place) for place in range(optima)])


@given(st.lists(st.integers(1, 60), min_size=1, max_size=6), st.integers(0, 12))
def test_no_mark_lies_on_the_frame_or_on_the_border_of_a_level(counts, optima):
    drawn = panel(counts, optima)
    canvas = drawn.canvas
    at = canvas.place(np.stack([drawn.across, np.full(len(drawn.across), canvas.low[1])], axis=1))[:, 0]
    band = canvas.width / (len(counts) + bool(optima))
    at = np.concatenate([at, canvas.width / (canvas.high[0] or 1.0) * drawn._places])
    distance = np.abs(at - band * np.round(at / band))
    assert distance.min() > LARGEST
    bands = np.repeat(np.arange(len(counts)), counts)
    np.testing.assert_array_equal(np.floor(drawn.across), bands)
    assert (np.diff(drawn.across) > 0).all()


def test_one_start_stands_in_the_middle_of_its_level():
    assert panel([36, 1, 1], 3).across[-2:] == pytest.approx([1.5, 2.5])
