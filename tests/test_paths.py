"""The missing part of a path is said in words, with a similar name that may be meant."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paretoik.paths import OPTIONS, missing_file, shell_command


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
        ("thumb", "no such file"),
        ("runs/frist/run.json", "no folder {}/runs/frist; did you mean 'first'?"),
        ("runs/frist.txt", "no such file; did you mean 'first.txt'?"),
        ("none/of/these/at/all", "no folder {}/none"),
        ("arm.urdf/run.json", "a path through {}/arm.urdf, which is no folder"),
        ("runs", "a folder"),
        ("lost", "a link that leads to nothing"),
        ("linked", "a link"),
        ("ahead", "a link to a folder"),
        ("x.urdf", "no such file"),  # only its ending is that of arm.urdf
        ("x" * 300, "a path that cannot be followed, File name too long"),
        ("a\0b", "a path that cannot be followed, embedded null byte"),
        ("pipe", "something else"),
    ],
)
def test_the_first_part_that_is_missing_is_named_with_what_may_be_meant(folder, path, words):
    assert missing_file(folder / path) == words.format(folder)


def test_of_a_relative_path_the_folder_is_named_that_it_starts_from(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert missing_file(Path("amr.urdf")) == f"no such file in {folder}; did you mean 'arm.urdf'?"
    assert missing_file(Path("run/first/run.json")) == f"no folder run in {folder}; did you mean 'runs'?"


def test_of_a_folder_with_very_many_files_some_are_looked_at(tmp_path):
    count = min(OPTIONS.entries, 5000)
    for number in range(count + 1):
        (tmp_path / sha256(b"%d" % number).hexdigest()).touch()  # no name is similar to another
    with os.scandir(tmp_path) as entries:
        names = [entry.name for entry in entries]
    assert missing_file(tmp_path / f"{names[count - 1]}.urdf").endswith(f"did you mean '{names[count - 1]}'?")
    assert missing_file(tmp_path / f"{names[count]}.urdf") == "no such file"


SHELLS = [shell for shell in ("sh", "dash", "bash", "ksh", "zsh") if shutil.which(shell)]
PRINT_ARGUMENTS = "import os, sys; sys.stdout.buffer.write(b'\\0'.join(map(os.fsencode, sys.argv[1:])))"
NAMES = st.text(st.characters(blacklist_characters="\0/", blacklist_categories=["Cs"]), min_size=1, max_size=20)
ODD = (
    "-x",
    "--help",
    "a  b",
    "it's",
    'so "so"',
    "a,b",
    "two\nlines",
    "end\n",
    "$HOME",
    "`id`",
    "100%",
    "a\\b",
    "größe",
    "~",
)


def arguments(shell: str, command: str) -> list[bytes]:
    """Return the arguments that a program gets from a command that is pasted into a shell."""
    ended = subprocess.run([shell, "-c", command], capture_output=True, check=True)
    return ended.stdout.split(b"\0")


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
@settings(max_examples=25, deadline=None)
@given(names=st.lists(NAMES, min_size=1, max_size=4))
@example(names=list(ODD))
@example(names=[os.fsdecode(b"no\xff text")])
def test_a_shell_reads_a_printed_command_as_it_was_meant(shell, encoding, names):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding))
        command = shell_command(sys.executable, "-c", PRINT_ARGUMENTS, *map(Path, names))
    assert command.splitlines() == [command]
    if encoding == "ascii":
        assert command.isascii()
    read = [Path(os.fsdecode(each)) for each in arguments(shell, command)]
    assert read == [Path(name) for name in names]
    assert not any(os.fsencode(each).startswith(b"-") for each in arguments(shell, command))
