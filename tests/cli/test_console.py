from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from paretoik.cli.console import exit_code
from tests.cli.commands import ROOT, strict


@pytest.mark.parametrize(
    ("status", "code"), [("generations", 0), ("time limit", 5), ("SIGINT", 130), ("interrupted", 130), ("SIGTERM", 143)]
)
def test_what_ended_a_run_is_its_exit_code(status, code):
    assert exit_code(status) == code


NOISY = """
import os, subprocess
from paretoik import Tracking, kinetic_energy, line
from paretoik.robot.arms import tringali_3r

subprocess.run(["echo", "from a program"], check=True)
os.write(1, b"past Python\\n")
print("from Python")

def one() -> Tracking:
    path = line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
    return Tracking(tringali_3r(), path, objectives=[kinetic_energy])
"""


def listed(tmp_path, redirection=""):
    """Return the name of a noisy file, and how a process of its own ended that lists it."""
    file = tmp_path / "noisy.py"
    file.write_text(NOISY)
    command = f"{shlex.join([sys.executable, '-m', 'paretoik', 'list', str(file), '--json'])} {redirection}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return file, subprocess.run(
        ["sh", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )


def test_what_a_users_file_and_its_programs_print_goes_to_stderr(tmp_path):
    file, ended = listed(tmp_path)
    assert strict(ended.stdout) == [{"problem": f"{file}:one", "about": ""}]
    assert sorted(ended.stderr.splitlines()) == ["from Python", "from a program", "past Python"]


def test_a_closed_stdout_is_no_fault(tmp_path):
    ended = listed(tmp_path, ">&-")[1]
    assert (ended.returncode, "Traceback" in ended.stderr) == (0, False)


def test_names_of_folders_and_files_steer_no_terminal(paretoik, finished, tmp_path):
    run = shutil.copytree(finished, tmp_path / "\x1b[2J\x07run")
    for words in (("report", run), ("compare", run, finished), ("verify", run), ("export", run, "--point", 1)):
        ended = paretoik(*words)
        assert ended.out or ended.err
        assert all(line.isprintable() for line in (ended.out + ended.err).splitlines()), words
