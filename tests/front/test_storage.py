from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.front.front import Front
from paretoik.runs.files import MOTIONS, RUN, TABLE
from tests.front.random_fronts import minima

FILES = (RUN, TABLE, MOTIONS)
THREADS = """
import sys
from pathlib import Path
import pyarrow.parquet
from paretoik.front.front import Front

before = len(list(Path("/proc/self/task").iterdir()))
Front.load(sys.argv[1])
print(len(list(Path("/proc/self/task").iterdir())) - before)
"""


def same(a: Front, b: Front) -> bool:
    arrays = ("ids", "objectives", "genes", "violation", "ranges")
    return (
        all(np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays)
        and (a.names, a.units, a.maximised, a.provenance) == (b.names, b.units, b.maximised, b.provenance)
        and np.array_equal(a.motions.q, b.motions.q)
        and np.array_equal(a.motions.time, b.motions.time)
        and tuple(a.motions.arm.joint_names) == tuple(b.motions.arm.joint_names)
    )


def seal(folder, run: dict) -> None:
    """Write `run` with a digest that agrees, as an attacker would."""
    run.pop("digest", None)
    digest = hashlib.sha256(json.dumps(run, sort_keys=True).encode()).hexdigest()
    (folder / RUN).write_text(json.dumps(run | {"digest": digest}))


def reseal(folder, name: str, content: bytes) -> None:
    """Replace the content of a file and make the digests agree."""
    (folder / name).write_bytes(content)
    run = json.loads((folder / RUN).read_text())
    run["files"][name] = hashlib.sha256(content).hexdigest()
    seal(folder, run)


def packed(**arrays) -> bytes:
    sink = io.BytesIO()
    np.savez(sink, **arrays)
    return sink.getvalue()


def test_what_is_saved_is_loaded_bit_for_bit(front, tmp_path):
    front.save(tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(FILES)
    assert same(Front.load(tmp_path), front)


def test_saving_twice_writes_the_same_bytes(front, tmp_path):
    front.save(tmp_path / "a")
    Front.load(tmp_path / "a").save(tmp_path / "b")
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_a_front_without_motions_and_genes_needs_no_file_for_them(tmp_path):
    bare = Front(ids=np.array([3]), objectives=np.ones((1, 2)), names=["a", "b"], units=["", ""], maximised=[False] * 2)
    bare.save(tmp_path)
    assert not (tmp_path / MOTIONS).exists()
    loaded = Front.load(tmp_path)
    assert loaded.motions is None
    assert loaded.genes is None
    assert loaded.violation is None


def test_a_front_with_certificates_but_without_violations_is_kept_too(tmp_path):
    certificates = minima(np.full((1, 2), 0.5), -np.ones((1, 2, 2)), np.zeros(1))
    bare = Front(
        ids=np.array([3]),
        objectives=np.ones((1, 2)),
        names=["a", "b"],
        units=["", ""],
        maximised=[False] * 2,
        certificates=certificates,
    )
    bare.save(tmp_path)
    np.testing.assert_array_equal(Front.load(tmp_path).certificates.violation, certificates.violation)


def test_an_empty_front_is_kept_too(tmp_path):
    none = np.empty((0, 2))
    Front(ids=np.empty(0, int), objectives=none, names=["a", "b"], units=["", ""], maximised=[False] * 2).save(tmp_path)
    assert len(Front.load(tmp_path)) == 0


def test_the_table_is_readable_by_others_with_units_and_empty_certificates(front, tmp_path):
    front.save(tmp_path)
    table = pq.read_table(tmp_path / TABLE)
    expected = ["id", "energy", "reach", "violation", "violation_between", "criticality", "status", "reason"]
    assert table.column_names == expected
    assert table.schema.field("energy").metadata == {b"unit": b"J s"}
    assert [table.column(name).null_count for name in expected] == [0, 0, 0, 0, 5, 5, 5, 5]


def test_no_objective_can_have_the_name_of_another_column(front, tmp_path):
    front.save(tmp_path / "run")
    columns = pq.read_table(tmp_path / "run" / TABLE).column_names
    for name in set(columns) - set(front.names):
        with pytest.raises(InvalidInput, match="front names must not be"):
            replace(front, names=(name, *front.names[1:]))


def test_the_run_file_is_strict_json_with_the_provenance(front, tmp_path):
    front.save(tmp_path)
    run = json.loads((tmp_path / RUN).read_text(), parse_constant=pytest.fail)
    assert run["format"] == 1
    assert (run["status"], run["seed"], run["points"]) == ("done", 1, 5)
    assert run["objectives"][1] == {"name": "reach", "unit": "m", "maximised": True, "range": [0.0, 25.0]}


@pytest.mark.parametrize("name", FILES)
def test_a_file_cut_anywhere_is_refused_and_named(front, tmp_path, name):
    front.save(tmp_path)
    content = (tmp_path / name).read_bytes()
    for length in [*range(0, min(64, len(content)), 7), *range(64, len(content) - 2, max(1, len(content) // 20))]:
        (tmp_path / name).write_bytes(content[:length])
        with pytest.raises(InvalidRun, match=name):
            Front.load(tmp_path)


@pytest.mark.parametrize("name", FILES)
def test_a_flipped_bit_gives_a_refusal_or_the_same_front(front, tmp_path, name):
    front.save(tmp_path)
    content = (tmp_path / name).read_bytes()
    refusals = []
    for place in range(0, len(content), max(1, len(content) // 50)):
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        (tmp_path / name).write_bytes(bytes(flipped))
        try:
            assert same(Front.load(tmp_path), front)
        except InvalidRun as refusal:
            refusals.append(str(refusal))
    assert len(refusals) > 15
    assert not any("\n" in refusal for refusal in refusals)


@pytest.mark.parametrize("name", [TABLE, MOTIONS])
def test_a_damaged_file_with_a_matching_digest_still_raises_nothing_but_our_error(front, tmp_path, name):
    front.save(tmp_path)
    content = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(3)
    refusals = []
    for _ in range(40):
        flipped = bytearray(content)
        for place in rng.integers(0, len(content), rng.integers(1, 4)):
            flipped[place] = rng.integers(256)
        reseal(tmp_path, name, bytes(flipped))
        try:
            assert len(Front.load(tmp_path)) == 5
        except InvalidRun as refusal:
            refusals.append(str(refusal))
    assert len(refusals) > 7
    assert not any("\n" in refusal for refusal in refusals)


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_a_link_and_a_pipe_are_refused(front, tmp_path, name):
    front.save(tmp_path)
    (tmp_path / name).rename(tmp_path / "elsewhere")
    with pytest.raises(InvalidRun, match=f"{name} must be a plain file, got no such file"):
        Front.load(tmp_path)
    (tmp_path / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InvalidRun, match=f"{name} must be a plain file, got a link"):
        Front.load(tmp_path)
    (tmp_path / name).unlink()
    os.mkfifo(tmp_path / name)
    with pytest.raises(InvalidRun, match=f"{name} must be a plain file, got something else"):
        Front.load(tmp_path)


class Trap:
    def __reduce__(self):
        return (os.mkdir, ("trapped",))


def test_a_pickle_in_the_archive_is_refused_and_never_run(front, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    front.save(tmp_path)
    objects = np.array([Trap()], dtype=object)
    for content in (packed(id=front.ids, q=objects), pickle.dumps(Trap()), packed(id=objects)):
        reseal(tmp_path, MOTIONS, content)
        with pytest.raises(InvalidRun, match=f"{MOTIONS} must be plain arrays"):
            Front.load(tmp_path)
    assert not (tmp_path / "trapped").exists()


@pytest.mark.parametrize(
    "arrays",
    [
        {"id": np.array([1, 2, 3, 4, 5])},
        {"q": np.full((5, 4, 2), np.nan)},
        {"joint_names": np.array(["a"])},
        {"genes": np.zeros((4, 2))},
    ],
)
def test_arrays_that_do_not_fit_the_table_are_refused(front, tmp_path, arrays):
    front.save(tmp_path)
    with np.load(tmp_path / MOTIONS) as stored:
        fitting = dict(stored)
    reseal(tmp_path, MOTIONS, packed(**(fitting | arrays)))
    with pytest.raises(InvalidRun):
        Front.load(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        lambda run: run.update(format=2),
        lambda run: run["files"].update({"../secret": "0"}),
        lambda run: run.update(objectives=[]),
        lambda run: run["objectives"][0].update(name="other"),
        lambda run: run["objectives"][0].update(range="ab"),
        lambda run: run["objectives"][1].update(maximised=False),
    ],
)
def test_a_run_file_that_does_not_describe_the_front_is_refused(front, tmp_path, change):
    front.save(tmp_path)
    run = json.loads((tmp_path / RUN).read_text())
    change(run)
    seal(tmp_path, run)
    with pytest.raises(InvalidRun):
        Front.load(tmp_path)


def test_a_run_that_has_no_front_yet_is_refused_with_its_status(tmp_path):
    (tmp_path / RUN).write_text('{"format": 1, "status": "running"}')
    with pytest.raises(InvalidRun, match="status 'running' without"):
        Front.load(tmp_path)


def test_files_of_two_runs_are_not_mixed(front, tmp_path):
    front.save(tmp_path / "a")
    other = replace(front, objectives=front.objectives * 2)
    other.save(tmp_path / "b")
    (tmp_path / "b" / TABLE).replace(tmp_path / "a" / TABLE)
    with pytest.raises(InvalidRun, match=f"{TABLE} must be the file that {RUN} belongs to"):
        Front.load(tmp_path / "a")


def test_a_full_disk_leaves_the_last_front_whole(front, tmp_path, monkeypatch):
    front.save(tmp_path)
    before = {name: (tmp_path / name).read_bytes() for name in FILES}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InvalidInput, match="must be writable, got No space left on device"):
        front.save(tmp_path)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts threads as Linux shows them")
def test_reading_a_front_leaves_no_thread_that_could_abort_the_interpreter_as_it_ends(front, tmp_path):
    front.save(tmp_path)
    ended = subprocess.run([sys.executable, "-c", THREADS, tmp_path], capture_output=True, text=True, check=True)
    assert ended.stdout == "0\n"
