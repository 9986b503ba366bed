"""The missing part of a path is said in words, with a similar name that may be meant."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from paretoik.file_paths import missing_file, shell_command


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "runs" / "first").mkdir(parents=True)
    for name in ("arm.urdf", "runs/first.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "lost").symlink_to(tmp_path / "gone")
    (tmp_path / "linked").symlink_to(tmp_path / "arm.urdf")
    (tmp_path / "ahead").symlink_to(tmp_path / "runs")
    os.mkfifo(tmp_path / "pipe")
    return tmp_path


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("amr.urdf", "no such file; did you mean 'arm.urdf'?"),
        ("runs/frist/run.json", "no folder {}/runs/frist; did you mean 'first'?"),
        ("arm.urdf/run.json", "a path through {}/arm.urdf, which is not a folder"),
        ("runs", "a folder"),
        ("lost", "a link that leads to nothing"),
        ("x" * 300, "a path that cannot be followed: File name too long"),
        ("pipe", "something else"),
    ],
)
def test_the_first_part_that_is_missing_is_named_with_what_may_be_meant(folder, path, words):
    assert missing_file(folder / path) == words.format(folder)


def test_of_a_relative_path_the_folder_is_named_that_it_starts_from(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert missing_file(Path("amr.urdf")) == f"no such file in {folder}; did you mean 'arm.urdf'?"
    assert missing_file(Path("run/first/run.json")) == f"no folder run in {folder}; did you mean 'runs'?"


@pytest.mark.parametrize("name", ["--help", "it's", "$HOME"])
def test_a_shell_reads_a_printed_command_as_it_was_meant(name):
    printing = "import sys; print(sys.argv[1])"
    command = shell_command(sys.executable, "-c", printing, Path(name))
    ended = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True)
    assert Path(ended.stdout.removesuffix("\n")) == Path(name)
    assert not ended.stdout.startswith("-")
