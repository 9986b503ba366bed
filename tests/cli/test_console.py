from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from paretoik.cli.console import process_output
from tests.cli.commands import PANDA, ROOT, strict

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
    """Return the name of a file that prints, and how a process that lists it ended."""
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
    for words in (("report", run), ("compare", run, finished), ("export", run, "--point", 1)):
        ended = paretoik(*words)
        assert ended.out or ended.err
        assert all(line.isprintable() for line in (ended.out + ended.err).splitlines()), words


# Commands on every kind of stdout and stderr: each has its result, and Python prints nothing of its own.


FULL = "/dev/full"
CODES = {  # by command; 0 for others
    "show": 2,  # there is no screen
    "solve": 5,
}
COMMANDS = {
    "solve": "solve MINE:good --out NEW --population 8 --generations 100000 --time-limit 1",
    "list": "list MINE",
    "select": "select RUN --knee --problem MINE:good",
    "show": "show RUN --problem MINE:good",
    "report": "report RUN --out NEW.html --problem MINE:good",
    "verify": "verify RUN --problem MINE:good",
    "check-robot": f"check-robot {shlex.quote(PANDA)}",
    "help": "solve --help",
}
ENVIRONMENTS = {
    "ASCII": {"PYTHONIOENCODING": "ascii"},
    "C": {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}
REDIRECTIONS = {
    "full stderr": f"2> {FULL}",
    "closed stdout": ">&-",
    "closed stderr": "2>&-",
    "all closed": "<&- >&- 2>&-",
}
"""How a shell may start a command, and all there is to say need not be said."""


def every(quick):
    """Return all commands; only the ``quick`` one is in the default run."""
    return [pytest.param(name, marks=() if name == quick else pytest.mark.slow) for name in COMMANDS]


@pytest.fixture
def start(mine, finished, tmp_path):
    """Return a function that starts a command in a shell, and tells how it ended."""
    run = shutil.copytree(finished, tmp_path / "run")
    without = ("DISPLAY", "WAYLAND_DISPLAY", "COLUMNS", "PYTHONIOENCODING")
    plain = {name: value for name, value in os.environ.items() if name not in without}

    def start(name: str, redirection: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
        words = COMMANDS[name].replace("NEW", str(tmp_path / "new")).replace("MINE", mine).replace("RUN", str(run))
        ended = subprocess.run(
            ["bash", "-c", f"{shlex.quote(sys.executable)} -m paretoik {words} {redirection}"],
            env=plain | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", **environment},
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        assert "Traceback" not in ended.stderr
        assert name != "solve" or (tmp_path / "new" / "motions.npz").is_file()
        assert name != "report" or (tmp_path / "new.html").stat().st_size > 0
        return ended

    return start


@pytest.mark.parametrize("environment", ENVIRONMENTS)
@pytest.mark.parametrize("name", every("check-robot"))
def test_a_terminal_of_ascii_letters_is_written_to_in_ascii(start, name, environment):
    ended = start(name, **ENVIRONMENTS[environment])
    assert ended.returncode == CODES.get(name, 0)
    assert ended.stdout.isascii()
    assert ended.stderr.isascii()
    assert ended.stdout or name == "show"
    assert "?" not in ended.stdout.replace("<?", "")


def test_letters_of_messages_have_plain_ones():
    with process_output():
        written = "2 levels of ε, χ² ≤ π, N²m²s ≥ −1, 3°".encode("ascii", "paretoik.plain")
    assert written == b"2 levels of eps, chi2 <= pi, N2m2s >= -1, 3 deg"


@pytest.mark.parametrize("name", every("select"))
def test_a_full_stdout_is_said_in_a_line_and_the_result_kept(start, name):
    ended = start(name, f"> {FULL}")
    assert ended.returncode == 2
    if name != "show":
        line = ended.stderr.splitlines()[-1]
        assert line == "error: stdout: the output could not be written completely: No space left on device"


@pytest.mark.parametrize("redirection", REDIRECTIONS)
@pytest.mark.parametrize("name", every("check-robot"))
def test_streams_that_are_closed_or_full_change_no_exit_code(start, name, redirection):
    ended = start(name, REDIRECTIONS[redirection])
    assert ended.returncode == CODES.get(name, 0)
    assert bool(ended.stdout) == (name != "show" and "stderr" in redirection)


@pytest.mark.parametrize("name", every("check-robot"))
def test_a_reader_who_goes_changes_no_exit_code(start, name):
    ended = start(name, "| true; exit ${PIPESTATUS[0]}")
    assert ended.returncode == CODES.get(name, 0)
    assert "Broken pipe" not in ended.stderr
