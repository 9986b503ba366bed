"""The search of a control step: the legend names what is visible, and words explain the rest."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from paretoik.review.drawing.step_drawing import StepScene
from paretoik.review.recording.recorder import SearchedFront, SearchedStep
from tests.review.conftest import swinging_arm
from tests.review.reading import last_text, read, rows, static_words

LOOP = SearchedFront(names=("displacement", "share"), units=("rad", ""), maximised=(False, False), timeline="step")
TRADE_OFF = np.stack([np.linspace(0.0, 1.0, 6), np.linspace(1.0, 0.0, 6)], axis=1)


def step(objectives, reach: float, *, planar: bool = True) -> SearchedStep:
    """Return a search of six individuals whose arms differ by up to ``reach`` rad."""
    objectives = np.array(objectives)
    q = np.array([0.3, 0.5, 0.4]) + reach * np.linspace(0.0, 1.0, 6)[:, None] * np.ones(3)
    fronts = [front(each) for each in objectives]
    return SearchedStep(
        sample=7,
        arm=swinging_arm(planar),
        objectives=objectives,
        q=np.broadcast_to(q, (len(objectives), 6, 3)),
        fronts=fronts,
        chosen=np.array([each[0] for each in fronts]),
        target=np.array([1.0, 1.0, 0.0]),
    )


def front(F):
    dominated = ((F[None] <= F[:, None]).all(axis=2) & (F[None] < F[:, None]).any(axis=2)).any(axis=1)
    rows = np.flatnonzero(~dominated)
    return rows[np.argsort(F[rows, 0], kind="stable")]


def recorded(searched: SearchedStep, file):
    scene = StepScene(loop=LOOP, step=searched)
    with rr.RecordingStream("step") as stream:
        stream.save(file)
        scene.log(stream, {})
    return scene, read(file)


def legend(entities) -> set[str]:
    return {word.removeprefix("● ") for word in static_words(entities["/step_7/legend/words"])}


@pytest.mark.parametrize("planar", [True, False])
@pytest.mark.parametrize(("reach", "is_seen"), [(1e-6, False), (0.5, True)])
def test_arms_of_the_front_are_named_if_they_are_visible_next_to_the_chosen_one(tmp_path, reach, is_seen, planar):
    scene, entities = recorded(step([TRADE_OFF], reach, planar=planar), tmp_path / "step.rrd")
    assert ("arms of the front" in legend(entities)) == is_seen
    assert (scene.view().contents[1].contents[1].name == "arms of the front, step 7") == is_seen
    words = last_text(entities["/step_7/text"], "generation", 0)
    assert ("All arms of the front are below the white one, at most" in words) == (not is_seen)


def test_individuals_outside_the_axes_of_a_front_of_one_point_are_counted(tmp_path):
    best = np.concatenate([np.full((1, 2), -1.0), TRADE_OFF[1:]])
    _, entities = recorded(step([best, TRADE_OFF], 0.5), tmp_path / "step.rrd")
    drawn = rows(entities[r"/step_7/front/displacement\ -\ share/population"], "generation", "positions")
    assert [len(drawn[number]) for number in (0, 1)] == [1, 6]
    words = last_text(entities["/step_7/text"], "generation", 0)
    assert "1 point on its front" in words
    assert "5 of 6 individuals are outside the axes, which show the region around the front." in words
    assert "outside the axes" not in last_text(entities["/step_7/text"], "generation", 1)
