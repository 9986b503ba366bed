from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from paretoik.front.preferences import Weights
from paretoik.review.drawing.scatter import Scatter
from paretoik.review.recording.messages import Workcell
from paretoik.review.recording.recorder import Opening, RecorderOptions, SearchedFront, SearchEnd
from paretoik.review.recording_child import RecordingFile
from tests.review.reading import read, rows


@pytest.fixture(autouse=True)
def strict():
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def recording_file(file: Path, front) -> RecordingFile:
    cell = None if front.motions is None else Workcell(arm=front.motions.arm)
    scene = SearchedFront(names=front.names, units=front.units, maximised=front.maximised, workcell=cell)
    opening = Opening(
        file=str(file), title="a: test", scene=scene, live=False, options=RecorderOptions(), run=os.getppid()
    )
    return RecordingFile(opening, lambda **_: None)


def recorded(file: Path, front, generations, *, finished: bool = True, weights=None):
    """Record in this process instead of a child."""
    started = recording_file(file, front)
    for generation in generations:
        started.record(generation)
    started.look_after()
    choice = front.select(weights or Weights({front.names[0]: 1.0})) if len(front) else None
    if finished:
        started.complete(SearchEnd(front=front, choice=choice))
    else:
        started.close()
    return choice


@pytest.fixture(scope="module")
def search(tmp_path_factory, make_front, make_generations):
    """Return a front, its choice, and the entities of their recording."""
    file = tmp_path_factory.mktemp("search") / "review.rrd"
    front = make_front(2)
    return front, recorded(file, front, make_generations(2)), read(file)


def timelines(batches: list) -> set[str]:
    return {name for batch in batches for name in ("generation", "motion") if name in batch.schema.names}


@pytest.mark.parametrize("finished", [True, False])
@pytest.mark.parametrize("n_obj", [1, 3])
def test_every_generation_is_kept_exactly(n_obj, finished, tmp_path, make_front, make_generations):
    generations = make_generations(n_obj)
    recorded(tmp_path / "review.rrd", make_front(n_obj), generations, finished=finished)
    check_generations(read(tmp_path / "review.rrd"), generations)


def check_generations(entities, generations) -> None:
    for layer, exact in (("population", lambda g: g.population), ("front", lambda g: g.front)):
        F = rows(entities[f"/search/{layer}"], "generation", "F")
        assert sorted(F) == [0, 1, 2, 3]
        for generation in generations[:3]:
            np.testing.assert_array_equal(F[generation.number], exact(generation).ravel())
    volumes = rows(entities["/search/hypervolume"], "generation", "scalars")
    assert [float(volumes[number][0]) for number in range(4)] == [0.5, 1.5, 2.5, 3.5]
    counts = rows(entities["/search/counts"], "generation", "scalars")
    assert counts[0].tolist() == [len(generations[0].front), 1.0]


def test_the_end_stands_on_both_timelines(search):
    front, choice, entities = search
    for timeline, time in (("generation", 3), ("motion", 0)):
        last = rows(entities["/search/front"], timeline, "F")[time]
        np.testing.assert_array_equal(last, front.objectives.ravel())
        np.testing.assert_array_equal(rows(entities["/search/front"], timeline, "ids")[time], front.ids)
        np.testing.assert_array_equal(rows(entities["/search/chosen"], timeline, "F")[time], choice.objectives)
    both = {"generation", "motion"}
    drawn = [path for path in entities if path.startswith(("/front/", "/arm/", "/joint_charts/", "/charts/"))]
    assert all(timelines(entities[path]) in (both, set()) for path in drawn)


def test_an_empty_front_is_recorded_as_such(tmp_path, make_front, make_generations):
    front = make_front(2, points=0)
    generations = make_generations(2, points=0)
    recorded(tmp_path / "review.rrd", front, generations)
    F = rows(read(tmp_path / "review.rrd")["/search/population"], "generation", "F")
    assert sorted(F) == [0, 1, 2, 3]


def test_a_failed_ending_keeps_the_recording_of_the_run(tmp_path, monkeypatch, make_front, make_generations):
    front = make_front(2)
    started = recording_file(tmp_path / "review.rrd", front)
    for generation in make_generations(2):
        started.record(generation)
    started.look_after()

    def fail(*_, **__):
        raise OSError("No space left on device")

    monkeypatch.setattr(Scatter, "log_generation", fail)
    with pytest.raises(OSError, match="No space left on device"):
        started.complete(SearchEnd(front=front))
    assert [file.name for file in tmp_path.iterdir()] == ["review.rrd"]
    assert sorted(rows(read(tmp_path / "review.rrd")["/search/front"], "generation", "F")) == [0, 1, 2, 3]
