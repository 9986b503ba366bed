from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from paretoik.paths import shell_command

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
    """Return what a program gets of a command that is pasted into a shell."""
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
