"""The recording of a run shows the choice, and survives damage to it or its folder."""

from __future__ import annotations

import shutil
import subprocess
import sys
from itertools import chain

import pyarrow
import pytest
import rerun as rr

import paretoik as pk
from paretoik.review.drawing.choice_layer import ROOTS, RecordedRun, recording_with_choice
from paretoik.review.recording.viewer import private_environment
from paretoik.runs.files import RECORDING, RUN, read_run
from paretoik.runs.folder import lock_folder
from tests.review.disks import small_disk
from tests.review.reading import blank_views, first_instants, read, static_values, views


def problem() -> pk.Tracking:
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11)
    limits = pk.Limits(position=2.5, velocity=20.0, acceleration=900.0, torque=90.0, power=900.0)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits)


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """The run of a short search, only for reading."""
    folder = tmp_path_factory.mktemp("runs") / "searched"
    pk.solve(problem(), population=16, generations=4, seed=1, refine=False, out=folder, observe=False)
    return folder


@pytest.fixture
def front(searched, tmp_path):
    """The front of a run that the test may change."""
    return pk.load_front(shutil.copytree(searched, tmp_path / "run"), problem())


@pytest.fixture(scope="module")
def choice_recordings(searched, tmp_path_factory):
    """The recordings of the run without and with a choice; every joint quantity is limited."""
    front, file = pk.load_front(searched, problem()), tmp_path_factory.mktemp("choice") / "choice.rrd"
    file.write_bytes(recording_with_choice(front, front[int(front.ids[0])], recording=searched / RECORDING))
    return searched / RECORDING, file


def recording(front):
    return front.folder / RECORDING


def text_of(file):
    return static_values(read(file)["/choice/text"], "text")[0]


def data(file):
    """Return all rows of a recording by entity, except those of the choice."""
    return {
        path: sorted(chain.from_iterable(map(rows_of, batches)))
        for path, batches in read(file).items()
        if path.split("/")[1] not in ROOTS
    }


def rows_of(batch):
    """Return the rows of a batch as words."""
    for name in [field.name for field in batch.schema if pyarrow.types.is_temporal(field.type)]:  # in nanoseconds
        batch = batch.set_column(batch.schema.names.index(name), name, batch.column(name).cast("int64"))
    return map(str, batch.to_pylist())


def verify(file):
    with private_environment() as environment:
        command = [sys.executable, "-m", "rerun", "rrd", "verify", str(file)]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_a_choice_is_in_the_recording_which_stays_complete_and_opens_on_it(front):
    file = recording(front)
    before, layout = data(file), views(file)
    choice = front.select("compromise")
    checked = verify(file)
    assert checked.returncode == 0, checked.stderr
    assert text_of(file).startswith(f"# Point {choice.id}, chosen")
    assert choice.verdict.split(".")[0] in text_of(file)
    assert data(file) == before
    assert views(file) != layout
    assert {"/choice/text", "/choice/arm"} <= set(views(file).values())


def test_a_later_choice_takes_the_place_of_a_former_one_and_nothing_piles_up(front):
    file = recording(front)
    ids = [int(id) for id in front.ids]
    front.select(ids[0])
    former = read(file)
    for id in (ids[-1], ids[0]):
        front.select(id)
        assert text_of(file).startswith(f"# Point {id}, ")
    again = read(file)
    assert former.keys() == again.keys()
    for path in former:  # as many rows, and no motion mixed with another's
        assert sum(batch.num_rows for batch in former[path]) == sum(batch.num_rows for batch in again[path]), path
    assert len(rr.chunk.RrdReader(file).blueprints()) == 2


def test_going_back_goes_back_in_the_recording_too(front):
    file = recording(front)
    before, layout = data(file), views(file)
    first, second = (front.select(int(id)) for id in front.ids[:2])
    assert text_of(file).startswith(f"# Point {second.id}, ")
    front.undo()
    assert text_of(file).startswith(f"# Point {first.id}, ")
    front.undo()
    assert views(file) == layout
    assert data(file) == before
    assert not [path for path in read(file) if path.split("/")[1] in ROOTS]
    assert verify(file).returncode == 0


def test_a_choice_whose_run_has_no_recording_needs_none(front):
    recording(front).unlink()
    choice = front.select("compromise")
    assert front.choices.chosen.point == choice.id
    assert not recording(front).exists()


def damage(file, kind):
    content = file.read_bytes()
    if kind == "a folder":
        file.unlink()
        file.mkdir()
    else:
        file.write_bytes({"cut": content[: len(content) // 2], "empty": b"", "something else": b"%PDF-1.7" * 99}[kind])


@pytest.mark.parametrize("kind", ["cut", "empty", "something else", "a folder"])
def test_an_invalid_recording_stays_unchanged_and_the_choice_is_kept(front, kind):
    file = recording(front)
    damage(file, kind)
    before = None if kind == "a folder" else file.read_bytes()
    with pytest.warns(RuntimeWarning, match="the choice is saved, but the recording is unchanged: ") as caught:
        choice = front.select("compromise")
    assert [str(each.message).count("\n") for each in caught] == [0]
    assert front.choices.chosen.point == choice.id
    assert file.is_dir() if before is None else file.read_bytes() == before


def test_a_running_process_owns_its_recording_and_the_choice_is_kept(front):
    before = recording(front).read_bytes()
    with (
        lock_folder(front.folder),
        pytest.warns(
            RuntimeWarning,
            match="the choice is saved, but the recording is unchanged: .*must have no other writer, got process",
        ),
    ):
        choice = front.select("compromise")
    assert front.choices.chosen.point == choice.id
    assert recording(front).read_bytes() == before


def test_on_a_full_disk_the_recording_stays_as_it_was_and_the_choice_is_kept(searched, tmp_path):
    with small_disk(tmp_path / "disk", "20m") as disk:
        front = pk.load_front(shutil.copytree(searched, disk / "run"), problem())
        before = recording(front).read_bytes()
        rest = shutil.disk_usage(disk).free - len(before) // 2
        (disk / "other").write_bytes(b"0" * rest)
        with pytest.warns(
            RuntimeWarning, match="the choice is saved, but the recording is unchanged: .*got No space left on device"
        ):
            choice = front.select("compromise")
        assert front.choices.chosen.point == choice.id
        assert recording(front).read_bytes() == before
        assert sorted(path.name for path in front.folder.iterdir() if RECORDING in path.name) == [RECORDING]


def test_a_process_in_which_rerun_records_nothing_replaces_nothing(front):
    """With RERUN=off no stream writes anything."""
    before, point = recording(front).read_bytes(), int(front.ids[0])
    script = f"import paretoik as pk; pk.Front.load({str(front.folder)!r}).select({point})"
    with private_environment() as environment:
        ended = subprocess.run(
            [sys.executable, "-c", script],
            env=environment | {"RERUN": "off"},
            capture_output=True,
            text=True,
            check=True,
        )
    assert "the choice is saved, but the recording is unchanged" in ended.stderr
    assert recording(front).read_bytes() == before
    assert front.choices.chosen.point == point


def test_a_recording_with_a_choice_is_still_the_same_run(front):
    before = read_run(front.folder / RUN)
    front.select("compromise")
    assert read_run(front.folder / RUN) == before
    assert pk.load_front(front.folder, problem()).objectives.tolist() == front.objectives.tolist()


def test_a_runs_views_next_to_a_choice_begin_with_the_run(choice_recordings):
    """A slider reaches back to the first logged data: those of a choice begin with the run, never before."""
    recording, chosen = choice_recordings
    begins = {name: int(begin.astype(int)) for name, begin in RecordedRun(recording).begins.items()}
    assert begins["generation"] == 1
    assert first_instants(chosen) == begins
    assert not blank_views(chosen, {name: (begin,) for name, begin in begins.items()})
