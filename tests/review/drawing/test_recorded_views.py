"""The views of a recorded run beside a choice: charts as large as they were drawn, with the names that they had."""

from __future__ import annotations

import pytest

import paretoik as pk
from paretoik.review.drawing.chosen_recording import recording_with_choice
from paretoik.review.drawing.recorded_views import read_recorded
from paretoik.task.limits import JOINT_UNITS
from tests.review.reading import blank_views, first_instants, read, static_values
from tests.review.view_sizes import layout_parts, tabs_of_charts, touching_words


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """The recording of a short search, and that with a choice; every quantity of joints is limited."""
    folder = tmp_path_factory.mktemp("recordings")
    problem = pk.Tracking(
        pk.arms.tringali_3r(),
        pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11),
        objectives=[pk.kinetic_energy, pk.torque_norm, pk.joint_travel],
        limits=pk.Limits(position=2.5, velocity=20.0, acceleration=900.0, torque=90.0, power=900.0),
    )
    front = pk.solve(problem, population=16, generations=4, seed=1, refine=False, out=folder / "run", observe=False)
    recording, chosen = folder / "run" / "review.rrd", folder / "choice.rrd"
    chosen.write_bytes(recording_with_choice(front, front[int(front.ids[0])], recording=recording))
    return recording, chosen


def charts(tabs):
    roots = ("parallel", "charts", "joint_charts")
    return {origin: each for origin, each in tabs.items() if origin.split("/")[1] in roots}


def test_beside_a_choice_charts_have_the_names_sizes_and_rows_of_tabs_that_they_were_drawn_with(recordings):
    recording, chosen = map(tabs_of_charts, recordings)
    assert {f"/joint_charts/{kind}" for kind in JOINT_UNITS} | {"/parallel", "/charts/best_2"} <= charts(chosen).keys()
    assert charts(chosen) == charts(recording)
    assert {recording[f"/joint_charts/{kind}"][2] for kind in JOINT_UNITS} == {2}


def test_every_chart_beside_a_choice_fills_its_view_and_is_nowhere_cut(recordings):
    recording, chosen = recordings
    entities, tabs = read(recording), charts(tabs_of_charts(chosen))
    for origin, (name, bounds, _) in tabs.items():
        if origin == "/parallel":
            continue
        words = static_values(entities[f"{origin}/labels"], "positions")
        lowest = max(y for _, y in words)
        assert bounds["y_range"][1] - 30.0 < lowest < bounds["y_range"][1], name
    measured = [origin for origin in tabs if origin != "/parallel"]
    assert not touching_words(chosen, [*measured, "/front", "/choice/front"])


def test_beside_a_choice_the_run_has_the_very_views_that_it_was_drawn_with(recordings):
    """Titles, words to read, and whatever a view of the recorded layout has; none has the name of the choice."""
    recording, chosen = recordings
    assert read_recorded(recording) == read_recorded(chosen)
    before, beside = map(layout_parts, recordings)
    recorded = {path: part for path, part in before.items() if path.split("/")[0] in ("container", "view")}
    assert recorded.items() <= beside.items()
    titles = {part.get("ViewBlueprint:display_name", [""])[0] for part in recorded.values()}
    assert {"front", "arm", "joint torque", "generation, chosen", "why"} <= titles


def test_where_a_run_begins_its_views_beside_a_choice_begin_too(recordings):
    """A slider reaches as far back as anything was logged: what a choice adds begins with the run, never before."""
    recording, chosen = recordings
    begins = {name: each.begin for name, each in read_recorded(recording).timelines.items()}
    assert begins["generation"] == 1
    assert first_instants(chosen) == begins
    assert not blank_views(chosen, {name: (begin,) for name, begin in begins.items()})
