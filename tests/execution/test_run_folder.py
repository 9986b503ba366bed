from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput
from paretoik.execution.run_folder import LOCK, claim_folder
from paretoik.run_files import CONTENTS, RUN, write_run

HOLDER = """
import sys, time
from paretoik.execution.run_folder import claim_folder
from paretoik.run_files import write_run
with claim_folder(sys.argv[1]) as folder:
    write_run(folder, {"status": "running"})
    print("held", flush=True)
    time.sleep(60)
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_new_folder_is_made_with_its_parents(tmp_path):
    with claim_folder(tmp_path / "runs" / "first") as folder:
        write_run(folder, {"status": "running"})
    assert json.loads((tmp_path / "runs" / "first" / RUN).read_text())["status"] == "running"


def test_a_second_writer_is_refused_by_name_until_the_first_ends(tmp_path):
    refused = pytest.raises(InvalidInput, match=f"only writer, got process {os.getpid()} at work")
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


def test_a_run_is_overwritten_only_when_told_and_only_its_own_files_go(tmp_path):
    with claim_folder(tmp_path) as folder:
        write_run(folder, {"status": "done"})
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "state.npz").touch()
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInput, match="permission to overwrite"), claim_folder(tmp_path):
        pass
    with claim_folder(tmp_path, overwrite=True):
        assert sorted(file.name for file in tmp_path.iterdir()) == [LOCK, "notes.txt"]


def test_a_checkpoint_that_is_a_link_is_removed_and_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "precious").touch()
    with claim_folder(tmp_path / "run") as folder:
        write_run(folder, {"status": "done"})
    (tmp_path / "run" / "checkpoint").symlink_to(tmp_path / "elsewhere")
    with claim_folder(tmp_path / "run", overwrite=True) as folder:
        assert not any((folder / name).exists() for name in CONTENTS)
    assert (tmp_path / "elsewhere" / "precious").exists()


def test_a_link_in_place_of_the_lock_is_not_followed(tmp_path):
    (tmp_path / "precious").write_text("text")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOCK).symlink_to(tmp_path / "precious")
    with pytest.raises(InvalidInput, match="wanted a folder to write a run into"), claim_folder(tmp_path / "run"):
        pass
    assert (tmp_path / "precious").read_text() == "text"


def test_what_a_killed_writer_left_half_written_does_not_bar_the_folder(tmp_path):
    (tmp_path / f".{RUN}.4711").write_text('{"form')
    with claim_folder(tmp_path) as folder:
        assert [file.name for file in folder.iterdir()] == [LOCK]


def test_a_file_where_the_folder_should_be_is_refused(tmp_path):
    (tmp_path / "taken").touch()
    for folder in (tmp_path / "taken", tmp_path / "taken" / "run"):
        with pytest.raises(InvalidInput, match="wanted a folder to write a run into"), claim_folder(folder):
            pass
