""""""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from paretoik.cli.console import exit_code, process_output
from tests.cli.commands import MINE, PANDA, ROOT, strict


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
    for words in (("report", run), ("compare", run, finished), ("verify", run), ("export", run, "--point", 1)):
        ended = paretoik(*words)
        assert ended.out or ended.err
        assert all(line.isprintable() for line in (ended.out + ended.err).splitlines()), words


# Every verb on every kind of stdout, stderr and terminal: it has its result, and Python prints nothing of its own.


FULL, NOWHERE = "/dev/full", "/dev/null"
SMALL = "--population 8 --generations 3 --seed 1"
CODES = {  # by verb; 0 for other verbs
    "show": 2,  # there is no screen
    "slow solve": 5,
}
VERBS = {
    "list": "list MINE",
    "solve": f"solve MINE:good --out NEW {SMALL}",
    "slow solve": "solve MINE:good --out NEW --population 8 --generations 100000 --time-limit 1",
    "plan": "plan MINE:single --out NEW --starts 4",
    "front": "front MINE:good --out NEW --points 3 --starts 4",
    "refine": "refine RUN --out NEW --problem MINE:good",
    "resume": "resume STOPPED --time-limit 60 --problem MINE:good",
    "select": "select RUN --knee --problem MINE:good",
    "navigate": "navigate CERTIFIED --point POINT --improve kinetic_energy --out NEW --problem MINE:good",
    "show": "show RUN --problem MINE:good",
    "export": "export RUN --point 0 --out NEW.csv --problem MINE:good",
    "report": "report RUN --out NEW.html --problem MINE:good",
    "compare": "compare RUN CERTIFIED",
    "verify": "verify RUN --problem MINE:good",
    "check-robot": f"check-robot {shlex.quote(PANDA)}",
    "help": "--help",
    "help of a verb": "solve --help",
}
KEEPING = ("solve", "slow solve", "plan", "front", "refine", "navigate", "export", "report")
QUICK = ("select",)
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
SINGLE = """
def single() -> Tracking:
    return tracking(kinetic_energy)
"""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A user's folder: a problem file, and runs in it."""

    folder: Path
    point: str

    def command(self, verb: str, new: Path) -> str:
        """Return a verb as a line for a shell, which writes ``new``."""
        words = VERBS[verb].replace("NEW", str(new)).replace("MINE", "users.py").replace("POINT", self.point)
        if "STOPPED" in words:
            shutil.copytree(self.folder / "stopped", new)
            words = words.replace("STOPPED", str(new))
        words = words.replace("CERTIFIED", "certified").replace("RUN", "run")
        return f"{shlex.quote(sys.executable)} -m paretoik {words}"


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Place:
    folder = tmp_path_factory.mktemp("output")
    (folder / "users.py").write_text(MINE + SINGLE)
    for words in (
        f"solve users.py:good --out run {SMALL}",
        "front users.py:good --out certified --points 3 --starts 4",
    ):
        assert ended(f"{shlex.quote(sys.executable)} -m paretoik {words}", folder).returncode == 0
    stopped = "solve users.py:good --out stopped --population 60 --generations 200 --time-limit 0.05"
    assert ended(f"{shlex.quote(sys.executable)} -m paretoik {stopped}", folder).returncode == 5
    point = ended(
        f"{shlex.quote(sys.executable)} -m paretoik select certified --compromise --problem users.py:good", folder
    ).stdout.split()[1]
    return Place(folder=folder, point=point)


def ended(line: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Return how a line of a shell ended."""
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env=surroundings(**environment),
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )


def surroundings(**environment: str) -> dict[str, str]:
    without = ("DISPLAY", "WAYLAND_DISPLAY", "COLUMNS", "PYTHONIOENCODING")
    plain = {name: value for name, value in os.environ.items() if name not in without}
    return plain | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", **environment}


def verbs(*, slow: tuple[str, ...] = tuple(set(VERBS) - set(QUICK))) -> list[object]:
    """Return all verbs; ``-m slow`` is required for the long ones."""
    return [pytest.param(verb, marks=pytest.mark.slow if verb in slow else ()) for verb in VERBS]


def check_kept(verb: str, new: Path) -> None:
    """Compare the result of a verb with the files that it keeps."""
    if verb in ("export", "report"):
        assert new.with_suffix(".csv" if verb == "export" else ".html").stat().st_size > 0
    elif verb in KEEPING:
        assert (new / "motions.npz").is_file()


@pytest.mark.parametrize("environment", ENVIRONMENTS)
@pytest.mark.parametrize("verb", verbs())
def test_a_terminal_of_ascii_letters_is_written_to_in_ascii(place, tmp_path, verb, environment):
    ran = ended(place.command(verb, tmp_path / "new"), place.folder, **ENVIRONMENTS[environment])
    assert "Traceback" not in ran.stderr
    assert ran.returncode == CODES.get(verb, 0)
    assert ran.stdout.isascii()
    assert ran.stderr.isascii()
    assert ran.stdout or verb == "show"
    assert "?" not in ran.stdout.replace("<?", "")
    check_kept(verb, tmp_path / "new")


def test_letters_of_messages_have_plain_ones():
    with process_output():
        written = "2 levels of ε, χ² ≤ π, N²m²s ≥ −1, 3°".encode("ascii", "paretoik.plain")
    assert written == b"2 levels of eps, chi2 <= pi, N2m2s >= -1, 3 deg"


@pytest.mark.parametrize("verb", verbs())
def test_a_full_stdout_is_said_in_a_line_and_the_result_kept(place, tmp_path, verb):
    ran = ended(f"{place.command(verb, tmp_path / 'new')} > {FULL}", place.folder)
    assert "Traceback" not in ran.stderr
    assert ran.returncode == 2
    if verb != "show":
        line = ran.stderr.splitlines()[-1]
        assert line == "error: stdout must take the whole output, got No space left on device"
    check_kept(verb, tmp_path / "new")


@pytest.mark.parametrize("redirection", REDIRECTIONS)
@pytest.mark.parametrize("verb", verbs())
def test_streams_that_are_closed_or_full_change_no_exit_code(place, tmp_path, verb, redirection):
    ran = ended(f"{place.command(verb, tmp_path / 'new')} {REDIRECTIONS[redirection]}", place.folder)
    assert ran.returncode == CODES.get(verb, 0)
    assert "Traceback" not in ran.stderr
    assert bool(ran.stdout) == (verb != "show" and "stderr" in redirection)
    check_kept(verb, tmp_path / "new")


@pytest.mark.parametrize("verb", verbs())
def test_a_reader_who_goes_changes_no_exit_code(place, tmp_path, verb):
    line = f"{place.command(verb, tmp_path / 'new')} | true; exit ${{PIPESTATUS[0]}}"
    ran = ended(line, place.folder)
    assert ran.returncode == CODES.get(verb, 0)
    assert "Traceback" not in ran.stderr
    assert "Broken pipe" not in ran.stderr
    check_kept(verb, tmp_path / "new")
