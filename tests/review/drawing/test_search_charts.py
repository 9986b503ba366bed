"""The texts of legends."""

from __future__ import annotations

from typing import get_args

import pytest

from paretoik.formulations.protocol import Timeline
from paretoik.review.drawing.loop_drawing import ENTRIES
from paretoik.review.drawing.search_charts import search_entries
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorder import SearchedFront


@pytest.mark.parametrize("timeline", get_args(Timeline))
@pytest.mark.parametrize("n_obj", [2, 3, 4])
def test_no_two_things_in_the_picture_of_a_front_have_one_colour(timeline, n_obj):
    names = tuple(f"objective {number}" for number in range(n_obj))
    scene = SearchedFront(names=names, units=("",) * n_obj, maximised=(False,) * n_obj, timeline=timeline)
    colours = [colour[:3] for _, colour in search_entries(scene, None, walked=True)]
    assert len(set(colours)) == len(colours)


def test_all_that_the_search_of_a_step_shows_has_an_entry_in_its_colour():
    colours = {colour for _, colour in ENTRIES}
    assert {SCREEN.population, SCREEN.front, SCREEN.chosen, SCREEN.arm, SCREEN.ghost, SCREEN.target} <= colours
