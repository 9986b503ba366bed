"""Parallel coordinates: every tick has its number, and lines have the colours of the legend."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from paretoik.review.drawing.axes import TEXT, ParallelAxes
from paretoik.review.drawing.layout import BULLET
from tests.review.reading import read, static_values, static_words


@pytest.mark.parametrize("n_obj", [3, 4, 5])
def test_every_tick_has_the_number_of_the_value_that_a_line_has_there(tmp_path, n_obj):
    rng = np.random.default_rng(0)
    F = 10.0 ** rng.uniform(-3.0, 3.0, n_obj) * rng.uniform(-1.0, 1.0, (12, n_obj))
    names = tuple(f"objective {number}" for number in range(n_obj))
    axes = ParallelAxes.around("parallel", names, F)
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "axes.rrd")
        axes.log(stream, static=True)
    entities = read(tmp_path / "axes.rrd")
    strips = np.array(static_values(entities["/parallel/axes/lines"], "strips"))
    upright = strips[:, 0, 0] == strips[:, 1, 0]
    across, ticks = strips[upright][:, 0, 0], strips[~upright].mean(axis=1)
    words = static_words(entities["/parallel/axes/labels"])
    middles = np.array(static_values(entities["/parallel/axes/labels"], "positions")) + np.array([0.0, TEXT.drop])
    numbers = [(word, middle) for word, middle in zip(words, middles, strict=True) if word not in names]
    assert len(numbers) == len(ticks)
    for axis, x in enumerate(across):
        on_axis = ticks[ticks[:, 0] == x]
        assert len(on_axis) >= 2
        for place in on_axis:
            word, _ = min(numbers, key=lambda each, place=place: float(np.linalg.norm(each[1] - place)))
            share = (float(word) - axes.low[axis]) / (axes.high[axis] - axes.low[axis])
            height = strips[upright][0].max()
            assert place[1] == pytest.approx((1.0 - share) * height, abs=0.02 * height)


@pytest.mark.parametrize("ends", [(721.3, 1629.4), (0.0502, 0.124), (-0.04, 1.04)])
def test_inner_axes_end_in_round_numbers_near_the_values(ends):
    F = np.repeat(np.array(ends)[:, None], 3, axis=1)
    axes = ParallelAxes.around("parallel", ("a", "b", "c"), F)
    low, high = axes.low[1], axes.high[1]
    assert low < ends[0] < ends[1] < high
    assert high - low < 1.3 * (ends[1] - ends[0])
    assert all(len(f"{end:.6g}".strip("-0.").replace(".", "")) <= 3 for end in (low, high))


@pytest.fixture(scope="module")
def recordings(choice_recordings):
    return tuple(map(read, choice_recordings))


def colours(batches: list) -> set[int]:
    """Return the colours of an entity at all times."""
    return {
        colour
        for batch in batches
        for name in batch.schema.names
        if name.endswith(":colors")
        for row in batch.column(name).to_pylist()
        for colour in row or ()
    }


def legend(entities, origin: str) -> dict[str, int]:
    words = [word.removeprefix(BULLET) for word in static_words(entities[f"{origin}/words"])]
    return dict(zip(words, static_values(entities[f"{origin}/words"], "colors"), strict=True))


@pytest.mark.parametrize(
    ("layer", "name"),
    [("front", "front"), ("final", "final front"), ("chosen", "compromise"), ("looked_at", "point looked at")],
)
def test_lines_have_the_colour_that_the_legend_gives_them(recordings, layer, name):
    recording, _ = recordings
    assert colours(recording[f"/parallel/{layer}"]) == {legend(recording, "/legend")[name]}


def test_lines_beside_a_choice_have_the_colour_that_its_legend_gives_them(recordings):
    _, chosen = recordings
    entries = legend(chosen, "/choice/legend")
    assert colours(chosen["/choice/parallel/front"]) == {entries["front"]}
    (name,) = [word for word in entries if word.startswith("point ")]
    assert colours(chosen["/choice/parallel/choice"]) == {entries[name]}
