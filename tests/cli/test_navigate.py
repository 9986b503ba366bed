from __future__ import annotations

import shutil

import numpy as np
import pytest

import paretoik as pk
from paretoik.loading import load_problem
from paretoik.review.drawing.choice_layer import ROOTS
from paretoik.runs.files import RECORDING
from tests.cli.commands import load_front, strict
from tests.review.reading import blank_views, read, views


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, mine):
    """A run with a certified front and its recording, only to be read."""
    out, reference = tmp_path_factory.mktemp("runs") / "recorded", f"{mine}:good"
    pk.epsilon_front(load_problem(reference), points=4, starts=4, reference=reference, out=out, observe=False)
    return out


@pytest.fixture
def run(recorded, tmp_path):
    """A copy of the run, without views that a command would draw again."""
    return shutil.copytree(recorded, tmp_path / "run", ignore=shutil.ignore_patterns("*.rrd", "*.png"))


def middle(folder):
    front = load_front(folder)
    return int(front.ids[len(front) // 2])


def test_the_run_gains_the_point_and_loses_nothing(paretoik, run):
    before, start = load_front(run), middle(run)
    ended = paretoik("navigate", run, "--point", start, "--improve", "kinetic_energy")
    assert ended.code == 0
    assert f"From point {start} to new point" in ended.out
    after = load_front(run)
    assert len(after) == len(before) + 1
    rows = [int(np.flatnonzero(after.ids == id)[0]) for id in before.ids]
    assert np.array_equal(after.objectives[rows], before.objectives)
    assert np.array_equal(after.motions.q[rows], before.motions.q)
    assert after.navigated.id not in before.ids
    assert after.certificates.criticality[after.navigated.index] <= 1e-6


def test_another_folder_leaves_the_run_as_it_was(paretoik, run, tmp_path):
    before, start = (run / "run.json").read_bytes(), middle(run)
    words = ("navigate", run, "--point", start, "--improve", "torque_norm", "--by", 1e-3, "--out", tmp_path / "new")
    said = strict(paretoik(*words, "--json").out)
    assert (run / "run.json").read_bytes() == before
    moved = load_front(tmp_path / "new")
    assert said["to"] == said["id"] == moved.navigated.id
    assert said["change"]["torque_norm"] == pytest.approx(-1e-3, rel=1e-5)
    assert paretoik(*words).code == 2  # there is a run now


def test_a_wrong_wish_is_one_line_and_changes_nothing(paretoik, run):
    before = (run / "run.json").read_bytes()
    for words in (("--point", 99, "--improve", "kinetic_energy"), ("--point", middle(run), "--improve", "time")):
        ended = paretoik("navigate", run, *words)
        assert ended.code == 2
        assert len(ended.err.strip().splitlines()) == 1
    assert (run / "run.json").read_bytes() == before


def test_without_a_point_it_moves_from_the_present_choice_and_says_which(paretoik, run):
    front = load_front(run)
    first, second = (int(id) for id in front.ids[[2, 3]])
    for id in (first, second):
        front.select(id)
    ended = paretoik("navigate", run, "--improve", "kinetic_energy")
    assert ended.code == 0
    assert ended.out.startswith(f"from the present choice, point {second}:\n")
    assert f"From point {second} to " in ended.out
    assert load_front(run).choices.chosen.point == second


def test_a_point_of_a_stopped_run_outlives_its_resumption(paretoik, mine, tmp_path):
    out, reference = tmp_path / "run", f"{mine}:good"
    problem = load_problem(reference)
    pk.epsilon_front(problem, points=2, starts=2, observe=False)  # compiles, which takes longer than the limit
    pk.epsilon_front(problem, points=10**4, starts=2, time_limit=10.0, observe=False, out=out, reference=reference)
    stopped = load_front(out)
    assert stopped.provenance["status"] == "time limit"
    start = stopped.ids[stopped.certificates.status == "minimum"][-1]
    ended = paretoik("navigate", out, "--point", start, "--improve", "kinetic_energy", "--problem", reference)
    assert ended.code == 0, ended
    (place,) = tmp_path.glob("run-point-*")
    assert np.array_equal(load_front(out).ids, stopped.ids)
    before = {file.name: file.read_bytes() for file in place.iterdir() if file.is_file()}
    assert paretoik("resume", out, "--problem", reference, "--time-limit", "4").code == 5
    assert {file.name: file.read_bytes() for file in place.iterdir() if file.is_file()} == before


def search_entities(file):
    return {path for path in read(file) if path.split("/")[1] not in ROOTS}


def test_another_folder_has_a_recording_that_shows_the_new_point_and_the_run_keeps_its_own(
    paretoik, recorded, tmp_path
):
    run, out = shutil.copytree(recorded, tmp_path / "run", ignore=shutil.ignore_patterns("*.png")), tmp_path / "new"
    before = (run / RECORDING).read_bytes()
    words = ("navigate", run, "--point", middle(run), "--improve", "torque_norm", "--out", out)
    assert paretoik(*words).code == 0
    assert (run / RECORDING).read_bytes() == before
    assert f"Point {load_front(out).navigated.id}" in str(read(out / RECORDING))
    assert search_entities(out / RECORDING) == search_entities(recorded / RECORDING)
    assert set(views(out / RECORDING).values()) != set(views(run / RECORDING).values())
    assert blank_views(out / RECORDING, {"motion": (0,)}) == []
