"""The file of a long run stays small, and says what was left out."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.review.recording.recorder import Generation, Opening, RecorderOptions, SearchedFront, SearchEnd
from paretoik.review.recording_child import LIVE, RecordingFile
from tests.review.conftest import sphere
from tests.review.reading import read, rows

N_OBJ = 2
NAMES = tuple(f"f{axis}" for axis in range(N_OBJ))


@pytest.fixture(autouse=True)
def strict():
    yield
    rr.set_strict_mode(False)


def generation(number: int, points: int = 60) -> Generation:
    F = sphere(points, N_OBJ, number)
    ids = np.arange(points, dtype=np.int64)
    return Generation(number=number, population=F[:40], front=F, front_ids=ids, reference=np.full(N_OBJ, 3.0))


def front(points: int = 70) -> Front:
    F = sphere(points, N_OBJ, 1000)
    return Front(ids=np.arange(points), objectives=F, names=NAMES, units=[""] * N_OBJ, maximised=[False] * N_OBJ)


def started(file: Path, *, live: bool = False, run: int | None = None, **options) -> RecordingFile:
    scene = SearchedFront(names=NAMES, units=("",) * N_OBJ, maximised=(False,) * N_OBJ)
    settings = RecorderOptions(share=1000.0, **options)  # it draws every time
    alive = os.getppid() if run is None else run
    opening = Opening(file=str(file), title="long", scene=scene, live=live, options=settings, run=alive)
    return RecordingFile(opening, lambda **_: None)


def fronts(file: Path) -> dict[int, np.ndarray]:
    return rows(read(file)["/search/front"], "generation", "F")


@pytest.mark.parametrize("spacing", [1, 8])
def test_a_file_stays_below_its_size_with_evenly_spread_generations_the_first_and_the_last(spacing, tmp_path):
    file, size, largest = tmp_path / "review.rrd", 400_000, 0
    recording, numbers = started(file, size=size), range(1, 1 + 20 * spacing, spacing)
    for place, number in enumerate(numbers):
        recording.record(generation(number))
        if place % 7 == 0:
            recording.look_after()
            largest = max(largest, file.stat().st_size)
    recording.complete(SearchEnd(front=front()), 3)
    assert recording.stride > 1
    assert max(largest, file.stat().st_size) < size
    F, kept = fronts(file), {number for number in numbers if (number - 1) % recording.stride == 0} | {numbers[-1]}
    assert sorted(F) == sorted(kept)
    for number in sorted(F)[:-1]:
        np.testing.assert_array_equal(F[number], generation(number).front.ravel())
    np.testing.assert_array_equal(F[numbers[-1]], front().objectives.ravel())
    (note,) = read(file)["/notes/left_out"]
    assert f"{len(kept)} of its 23 generations are kept here" in str(note.to_pydict())  # 3 were not sent


def test_a_series_that_says_the_same_number_again_and_again_ends(tmp_path):
    recording = started(tmp_path / "review.rrd", size=1_000)
    for _ in range(4):
        recording.record(generation(1))
        recording.look_after()
    recording.complete(SearchEnd(front=front()))
    assert sorted(fronts(tmp_path / "review.rrd")) == [1]


def test_a_short_run_is_kept_completely_without_a_note(tmp_path):
    file = tmp_path / "review.rrd"
    recording = started(file)
    for number in range(5):
        recording.record(generation(number))
        recording.look_after()
    recording.complete(SearchEnd(front=front(50)))
    assert sorted(fronts(file)) == [0, 1, 2, 3, 4]
    assert "/notes/left_out" not in read(file)


def test_fronts_on_the_way_are_drawn_in_part_and_the_last_one_whole(tmp_path):
    file = tmp_path / "review.rrd"
    recording = started(file, points=25)
    for number in range(3):
        recording.record(generation(number))
    recording.complete(SearchEnd(front=front()))
    F = fronts(file)
    assert [F[number].size // N_OBJ for number in range(3)] == [25, 25, 70]
    np.testing.assert_array_equal(F[2], front().objectives.ravel())
    counts = rows(read(file)["/search/counts"], "generation", "scalars")
    assert [counts[number][0] for number in range(2)] == [60.0, 60.0]
    (note,) = read(file)["/notes/left_out"]
    assert "25 points" in str(note.to_pydict())


def test_the_recording_of_a_killed_run_leaves_the_file_of_another_run_alone(tmp_path):
    file = tmp_path / "review.rrd"
    recording = started(file, run=0)
    recording.record(generation(1))
    file.unlink()
    file.write_text("another run's")
    with pytest.raises(InvalidInput, match="another run"):
        recording.complete(SearchEnd(front=front()))
    assert file.read_text() == "another run's"
    assert [left.name for left in tmp_path.iterdir()] == ["review.rrd"]
    with pytest.raises(FileExistsError):
        started(file, run=0)
    resumed = started(file)  # the run that lives writes its file, also if that of the killed run writes meanwhile
    file.unlink()
    file.write_text("the killed run's")
    resumed.record(generation(1))
    resumed.complete(SearchEnd(front=front()))
    assert fronts(file)


def test_viewers_get_their_time_to_read_the_end_once(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    pauses, sleep = [], time.sleep
    monkeypatch.setattr(time, "sleep", lambda seconds: (pauses.append(seconds), sleep(seconds)))
    recording = started(tmp_path / "review.rrd", live=True)
    recording.record(generation(1))
    recording.complete(SearchEnd(front=front()))
    recording.close()
    assert pauses.count(LIVE.reading) == 1
