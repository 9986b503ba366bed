"""Files that belong together are replaced all at once or not at all, whenever the process is killed."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput
from paretoik.runs.file_replacement import SAVED, only_writer, replace_file, replace_files, without_writers

OLD = {"a": b"old", "b": b"old"}
NEW = {"a": b"new and longer", "b": b"new", "c": b"new"}
WRITER = """
import os, signal, sys
from pathlib import Path
from paretoik.runs.file_replacement import only_writer, replace_files

folder, last = Path(sys.argv[1]), int(sys.argv[2])
events = 0

def count(event, arguments):
    global events
    events_of_files = "open", "os.mkdir", "os.rename", "os.rmdir", "os.remove"
    if event in events_of_files and (str(folder) in str(arguments[0]) or not os.path.isabs(str(arguments[0]))):
        events += 1
        if events == last:
            os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(count)
with only_writer(folder):
    replace_files(folder, {"a": b"new and longer", "b": b"new", "c": b"new"})
print(events)
"""


def write(folder: Path, *, last: int) -> subprocess.CompletedProcess[str]:
    """Replace the files of a folder in a process that kills itself before the last event on them."""
    command = [sys.executable, "-c", WRITER, str(folder), str(last)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def contents(folder: Path) -> dict[str, bytes]:
    with without_writers(folder):
        return {file.name: file.read_bytes() for file in folder.iterdir() if not file.name.startswith(".")}


def test_a_file_is_replaced_and_nothing_else_stays_behind(tmp_path):
    file = tmp_path / "deep" / "run.json"
    replace_file(file, b"before")
    replace_file(file, b"after")
    assert file.read_bytes() == b"after"
    assert [entry.name for entry in file.parent.iterdir()] == ["run.json"]


def test_a_full_disk_leaves_the_former_file_whole(tmp_path, monkeypatch):
    replace_file(tmp_path / "run.json", b"before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InvalidInput, match=r"run\.json must be writable, got No space left on device"):
        replace_file(tmp_path / "run.json", b"after")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("run.json", b"before")]


def test_wherever_the_writer_is_killed_all_files_are_the_old_ones_or_all_are_the_new(tmp_path):
    whole = tmp_path / "whole"
    whole.mkdir()
    events = int(write(whole, last=0).stdout)
    assert contents(whole) == NEW
    outcomes = []
    for last in range(1, events + 1):
        folder = tmp_path / str(last)
        folder.mkdir()
        for name, content in OLD.items():
            (folder / name).write_bytes(content)
        assert write(folder, last=last).returncode == -signal.SIGKILL
        outcomes.append(contents(folder))
    assert all(outcome in (OLD, NEW) for outcome in outcomes)
    is_new = [outcome == NEW for outcome in outcomes]
    assert is_new == sorted(is_new), "once saved, always saved"
    assert {True, False} <= set(is_new)


def test_the_next_writer_goes_on_from_what_a_killed_one_had_saved(tmp_path):
    (tmp_path / SAVED).mkdir()
    (tmp_path / SAVED / "a").write_bytes(b"saved")
    with only_writer(tmp_path):
        assert (tmp_path / "a").read_bytes() == b"saved"
        replace_files(tmp_path, {"b": b"next"})
    assert contents(tmp_path) == {"a": b"saved", "b": b"next"}


def test_a_folder_where_a_file_should_be_is_refused_and_all_files_stay(tmp_path):
    replace_file(tmp_path / "a", b"old")
    (tmp_path / "b").mkdir()
    with pytest.raises(InvalidInput, match=r"b must be a file to write, got a folder"), only_writer(tmp_path):
        replace_files(tmp_path, NEW)
    assert (tmp_path / "a").read_bytes() == b"old"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a", "b"]


def test_readers_wait_for_a_writer_and_read_beside_each_other(tmp_path):
    with without_writers(tmp_path), without_writers(tmp_path):
        reader = os.open(tmp_path, os.O_RDONLY)
        try:
            with pytest.raises(BlockingIOError):
                fcntl.flock(reader, fcntl.LOCK_EX | fcntl.LOCK_NB)
        finally:
            os.close(reader)
