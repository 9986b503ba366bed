from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from paretoik import __version__
from tests.cli.commands import PANDA, ROOT, Ended


def test_version_is_printed(paretoik):
    assert paretoik("--version") == Ended(0, f"paretoik {__version__}\n", "")


def test_help_names_every_command_and_the_exit_codes(paretoik):
    said = paretoik("--help").out
    for word in ("list", "solve", "select", "show", "check-robot", "--version", "3 infeasible", "6 interrupted"):
        assert word in said


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "missing.py:p", "--out", "OUT"], "problem file missing.py must be a file, got no such file in "),
        (["solve", "MINE:goood", "--out", "OUT"], "got 'goood'; did you mean 'good'?"),
        (["solve", "MINE:good", "--out", "OUT", "--seed", "-1"], "seed must be an integer of at least 0, got -1"),
        (["solve", "MINE:good", "--out", "MINE"], "must be a folder to write a run into, got File exists"),
        (["select", "OUT", "--weights", "kinetic_energy=1"], "run.json must be a plain file, got no folder "),
        (
            ["select", "RUN", "--weights", "kinetic_energy"],
            "weights must be NAME=NUMBER,NAME=NUMBER, got 'kinetic_energy'",
        ),
        (["select", "RUN", "--weights", "torque_norm=much"], "weights must be a number for torque_norm, got 'much'"),
        (
            ["select", "RUN", "--weights", "torque_norm=1,torque_norm=2"],
            "weights must have each objective once, got torque_norm twice",
        ),
        (["show", "OUT"], "review.rrd must be a recording, got no folder "),
        (["check-robot", "missing.urdf"], "missing.urdf"),
        (["check-robot", "PANDA", "--tip", "thumb"], "tip must be one of"),
    ],
)
def test_bad_input_is_one_line_on_stderr_and_exit_code_2(paretoik, mine, finished, tmp_path, words, message):
    names = {"MINE": mine, "OUT": str(tmp_path / "out"), "RUN": str(finished), "PANDA": PANDA}
    ended = paretoik(*(names.get(word, word.replace("MINE:", f"{mine}:")) for word in words))
    assert (ended.code, ended.out) == (2, "")
    error = ended.err.splitlines()[-1]
    assert error.startswith("error: ")
    assert message in error
    assert [line for line in ended.err.splitlines()[:-1] if not line.startswith("generation")] == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve"], "; see 'paretoik solve --help'"),
        (["solve", "x.py:y"], "Missing option '--out'"),
        (["solve", "x.py:y", "--out"], "Option '--out' requires an argument; see 'paretoik"),
        (["solve", "x.py:y", "--out", "o", "--seed", "x\ny"], "Invalid value for '--seed': "),
        (["solve", "x.py:y", "--out", "o", "--solver", "x"], "Invalid value for '--solver': "),
        (["solve", "x.py:y", "--populaton", "9"], "No such option: --populaton"),
        (["show", "a", "b (c)"], "(b (c)); see 'paretoik show --help'"),
        (["slove"], "No such command 'slove'"),
    ],
)
def test_words_that_make_no_command_are_one_line(paretoik, words, message):
    ended = paretoik(*words)
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("error: ")
    assert ended.err.count("\n") == 1
    assert message in ended.err


def test_a_warning_is_one_line_on_stderr(finished, tmp_path):
    copy = shutil.copytree(finished, tmp_path / "copy")
    command = [sys.executable, "-m", "paretoik", "select", str(copy), "--weights", "torque_norm=1"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert ended.stderr.startswith("warning: ")
    assert "motions come without their arm" in ended.stderr
    assert ended.stderr.count("\n") == 1
