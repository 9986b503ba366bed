"""The views of a recorded run beside a choice: charts as large as they were drawn, with the names that they had."""

from __future__ import annotations

from paretoik.review.drawing.choice_layer import read_recorded
from paretoik.task.limits import JOINT_UNITS
from tests.review.reading import blank_views, first_instants, read, static_values
from tests.review.view_sizes import layout_parts, tabs_of_charts, touching_words


def charts(tabs):
    roots = ("parallel", "charts", "joint_charts")
    return {origin: each for origin, each in tabs.items() if origin.split("/")[1] in roots}


def test_beside_a_choice_charts_have_the_names_sizes_and_rows_of_tabs_that_they_were_drawn_with(choice_recordings):
    recording, chosen = map(tabs_of_charts, choice_recordings)
    assert {f"/joint_charts/{kind}" for kind in JOINT_UNITS} | {"/parallel", "/charts/best_2"} <= charts(chosen).keys()
    assert charts(chosen) == charts(recording)
    assert {recording[f"/joint_charts/{kind}"][2] for kind in JOINT_UNITS} == {2}


def test_every_chart_beside_a_choice_fills_its_view_and_is_nowhere_cut(choice_recordings):
    recording, chosen = choice_recordings
    entities, tabs = read(recording), charts(tabs_of_charts(chosen))
    for origin, (name, bounds, _) in tabs.items():
        if origin == "/parallel":
            continue
        words = static_values(entities[f"{origin}/labels"], "positions")
        lowest = max(y for _, y in words)
        assert bounds["y_range"][1] - 30.0 < lowest < bounds["y_range"][1], name
    measured = [origin for origin in tabs if origin != "/parallel"]
    assert not touching_words(chosen, [*measured, "/front", "/choice/front"])


def test_beside_a_choice_the_run_has_the_very_views_that_it_was_drawn_with(choice_recordings):
    """Titles, words to read, and whatever a view of the recorded layout has; none has the name of the choice."""
    recording, chosen = choice_recordings
    assert read_recorded(recording) == read_recorded(chosen)
    alone, with_choice = map(layout_parts, choice_recordings)
    recorded = {path: part for path, part in alone.items() if path.split("/")[0] in ("container", "view")}
    assert recorded.items() <= with_choice.items()
    titles = {part.get("ViewBlueprint:display_name", [""])[0] for part in recorded.values()}
    assert {"front", "arm", "joint torque", "generation, chosen", "why"} <= titles


def test_where_a_run_begins_its_views_beside_a_choice_begin_too(choice_recordings):
    """A slider reaches as far back as anything was logged: what a choice adds begins with the run, never before."""
    recording, chosen = choice_recordings
    begins = {name: each.begin for name, each in read_recorded(recording).timelines.items()}
    assert begins["generation"] == 1
    assert first_instants(chosen) == begins
    assert not blank_views(chosen, {name: (begin,) for name, begin in begins.items()})
