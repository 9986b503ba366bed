""""""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput
from paretoik.runs.files import (
    CHECKPOINT,
    CHOICES,
    FORMER,
    JOURNAL,
    RECORDING,
    RUN,
    unfinished_note,
    write_run,
)
from paretoik.runs.folder import LOCK, SPACE, ReservedSpace, claim_folder, lock_folder
from studies.benchmarks.reliability.damage import namespaces_can_mount

HOLDER = """
import json, sys, time
from paretoik.runs.folder import claim_folder
from paretoik.runs.files import write_run
with claim_folder(sys.argv[1], overwrite=True) as folder:
    write_run(folder, json.loads(sys.argv[2]))
    print("held", flush=True)
    time.sleep(60)
"""
RESULT = {"status": "done", "files": {}}


def holder(folder: Path, entries: dict | None = None) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", HOLDER, str(folder), json.dumps(entries or {"status": "running"})]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_writer_is_refused_by_name_until_the_first_ends(tmp_path):
    refused = pytest.raises(InvalidInput, match=f"no other writer, got process {os.getpid()} at work")
    with claim_folder(tmp_path) as folder, refused, claim_folder(folder):
        pass
    with claim_folder(tmp_path) as folder:
        assert folder == tmp_path


def test_a_lock_does_not_outlive_a_killed_process(tmp_path):
    process = holder(tmp_path)
    try:
        with pytest.raises(InvalidInput, match=f"got process {process.pid} at work"), claim_folder(tmp_path):
            pass
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
    with claim_folder(tmp_path, overwrite=True) as folder:
        assert not (folder / RUN).exists()


def test_a_folder_that_holds_something_else_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("dear to someone")
    for overwrite in (False, True):
        with (
            pytest.raises(InvalidInput, match=r"got one that holds thesis\.tex"),
            claim_folder(tmp_path, overwrite=overwrite),
        ):
            pass
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize("content", ["", "[]", '{"speed": 3}', "not json", "[" * 100_000])
def test_a_run_file_of_another_program_does_not_make_a_run(tmp_path, content):
    (tmp_path / RUN).write_text(content)
    with pytest.raises(InvalidInput, match=r"got one that holds run\.json"), claim_folder(tmp_path, overwrite=True):
        pass
    assert (tmp_path / RUN).read_text() == content


def finished_run(folder: Path) -> dict[str, bytes]:
    """Make a run with a result in a folder, next to a file of the user's; return the contents of all its files."""
    with claim_folder(folder):
        write_run(folder, RESULT)
    (folder / "checkpoint").mkdir()
    (folder / "checkpoint" / "state.npz").write_text("state")
    (folder / CHOICES).write_text("choices")
    (folder / "notes.txt").write_text("mine")
    return contents(folder)


def contents(folder: Path) -> dict[str, bytes]:
    files = {str(file.relative_to(folder)): file for file in folder.rglob("*") if file.is_file()}
    return {name: file.read_bytes() for name, file in files.items() if name != LOCK}


def test_a_run_is_overwritten_only_when_told_and_only_its_own_files_go(tmp_path):
    finished_run(tmp_path)
    with pytest.raises(InvalidInput, match="use --overwrite"), claim_folder(tmp_path):
        pass
    with claim_folder(tmp_path, overwrite=True):
        assert sorted(file.name for file in tmp_path.iterdir()) == [FORMER, LOCK, "notes.txt"]
        write_run(tmp_path, RESULT)
    assert sorted(file.name for file in tmp_path.iterdir()) == [LOCK, "notes.txt", RUN]


@pytest.mark.parametrize("error", [InvalidInput, KeyboardInterrupt, SystemExit, None])
def test_a_run_is_back_as_it_was_where_the_new_one_comes_to_no_result(tmp_path, error):
    before = finished_run(tmp_path)
    with suppress(InvalidInput, KeyboardInterrupt, SystemExit), claim_folder(tmp_path, overwrite=True):
        write_run(tmp_path, {"status": "running"})
        (tmp_path / RECORDING).write_text("of the new one")
        (tmp_path / CHOICES).write_text("of the new one")
        if error is not None:
            raise error
    assert contents(tmp_path) == before


def test_a_new_run_that_has_a_result_stays_however_it_ends(tmp_path):
    finished_run(tmp_path)
    with suppress(KeyboardInterrupt), claim_folder(tmp_path, overwrite=True):
        write_run(tmp_path, RESULT)
        (tmp_path / RECORDING).write_text("of the new one")
        raise KeyboardInterrupt
    assert sorted(contents(tmp_path)) == ["notes.txt", RECORDING, RUN]


def test_a_killed_process_leaves_the_run_that_it_was_to_replace(tmp_path):
    before = finished_run(tmp_path)
    process = holder(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert unfinished_note(tmp_path) == f"; the run that it was to replace is in {tmp_path / FORMER}"
    with pytest.warns(RuntimeWarning, match="the run was restored"), lock_folder(tmp_path):
        assert contents(tmp_path) == before


def test_a_killed_process_with_a_result_has_replaced_the_run(tmp_path):
    finished_run(tmp_path)
    process = holder(tmp_path, RESULT)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    with pytest.raises(InvalidInput, match="use --overwrite"), claim_folder(tmp_path):
        pass
    assert sorted(contents(tmp_path)) == ["notes.txt", RUN]


def test_a_run_that_ended_for_want_of_a_motion_says_why_and_not_how_to_go_on(tmp_path):
    write_run(tmp_path, {"status": "Infeasible", "reason": "no motion within the limits"})
    (tmp_path / CHECKPOINT).mkdir()
    (tmp_path / CHECKPOINT / JOURNAL).write_bytes(b"")
    assert unfinished_note(tmp_path) == "; it ended with: no motion within the limits"


KILLED = """
import os, signal, sys
from paretoik.runs.folder import claim_folder
from paretoik.runs.files import write_run
rename = os.rename
def counted(*names, **folders):
    global left
    rename(*names, **folders)
    if not left:
        os.kill(os.getpid(), signal.SIGKILL)
    left -= 1
for left, place in enumerate(sys.argv[1:]):
    child = os.fork()
    if not child:
        os.rename = counted
        with claim_folder(place, overwrite=True) as folder:
            write_run(folder, {"status": "running"})
            (folder / "choices.json").write_text("of the new one")
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
MOVES = 2 * 3 + 2  # three entries out and back, and the folder around them renamed twice


def test_wherever_a_process_is_killed_while_it_moves_a_run_nothing_of_it_is_lost(tmp_path):
    folders = [tmp_path / str(moves) for moves in range(MOVES)]
    before = [finished_run(folder) for folder in folders]
    ended = subprocess.run([sys.executable, "-c", KILLED, *folders], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == [str(-signal.SIGKILL)] * MOVES
    for folder, contents_before in zip(folders, before, strict=True):
        with warnings.catch_warnings(action="ignore"), lock_folder(folder):
            assert contents(folder) == contents_before


def test_what_a_killed_writer_left_half_written_does_not_bar_the_folder(tmp_path):
    (tmp_path / f".{RUN}.4711").write_text('{"form')
    with claim_folder(tmp_path) as folder:
        assert [file.name for file in folder.iterdir()] == [LOCK]


# Disk space for a result: held before any computation, there when the disk is full, refused if there is too little.


ROOT = Path(__file__).parents[2]


def test_room_is_on_the_disk_until_it_is_left(tmp_path):
    file = tmp_path / "checkpoint" / "reserve"
    room = ReservedSpace(file)
    assert file.stat().st_size == SPACE
    assert file.stat().st_blocks * 512 >= SPACE
    room.release()
    room.release()
    assert not file.exists()
    room.take()
    assert file.stat().st_size == SPACE


def test_a_disk_without_room_is_refused_and_nothing_stays_on_it(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fail)
    words = r"must have 8 MB of free disk for the result, got [\d.e+]+ MB"
    with pytest.raises(InvalidInput, match=words):
        ReservedSpace(tmp_path / "checkpoint" / "reserve")
    assert list(tmp_path.iterdir()) == []


FILLED = """
import os
import sys
from pathlib import Path
import paretoik as pk
from tests.search.problems import Parabolas

disk = Path(sys.argv[1])

def fill(progress):
    if progress.stage == "generation" and progress.done == 2:
        try:
            with (disk / "else").open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(4096))
        except OSError:
            print(os.statvfs(disk).f_bavail)

pk.solve(Parabolas(), population=12, generations=6, seed=1, out=disk / "run", observe=fill)
front = pk.load_front(disk / "run")
print(front.provenance["status"], front.provenance["counts"]["generations"], len(front) > 0)
"""


@pytest.mark.skipif(not namespaces_can_mount(), reason="a system whose users may mount file systems in a namespace")
def test_the_result_is_saved_although_the_disk_was_filled_from_elsewhere(tmp_path):
    mount = 'mount -t tmpfs -o size=20M tmpfs "$0" && exec "$@" "$0"'
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", mount, str(tmp_path), sys.executable, "-c", FILLED]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout) == (0, "0\ngenerations 6 True\n"), ended.stderr
