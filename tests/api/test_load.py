""""""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.load import load_front
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput
from paretoik.runs.files import RECORDING
from tests.api.problems import QUICK, tracking


def test_a_saved_run_comes_back_with_its_motions_whole(problem, run):
    folder, front = run
    loaded = load_front(folder, problem)
    np.testing.assert_array_equal(loaded.objectives, front.objectives)
    np.testing.assert_array_equal(loaded.ids, front.ids)
    np.testing.assert_array_equal(loaded.motions.torque, front.motions.torque)
    assert loaded.provenance == front.provenance
    assert loaded.select(pk.Weights(torque_norm=1.0)).id == front.select(pk.Weights(torque_norm=1.0)).id


def test_another_problem_is_refused_by_its_fingerprint(run):
    with pytest.raises(InvalidInput, match=r"the run in .* solved, got one with another fingerprint"):
        load_front(run[0], tracking(velocity=6.5))


def test_a_run_whose_problem_is_not_given_comes_without_its_arm_and_a_warning(problem, tmp_path):
    solve(problem, **QUICK, out=tmp_path / "run", reference="gone.py:problem")
    with pytest.warns(RuntimeWarning, match=r"without their arm, .*only if you name it: .* --problem gone\.py:problem"):
        front = load_front(tmp_path / "run")
    assert len(front.motions) == len(front)


# Run folders may come from anybody: a named problem is loaded only if the user names it, or says yes on a terminal.


ROOT = Path(__file__).parents[2]
EVIL = "import pathlib\npathlib.Path({mark!r}).write_text('run')\ndef problem():\n    return None\nvalue = 3\n"
HOSTILE = {  # problems that runs name, by the names of the runs
    "current": "evil.py:problem",
    "python": "os:abort",
    "within": "runs/within/evil.py:problem",
    "beside": "runs/evil.py:problem",
    "link": "papers/evil.py:problem",
    "module": "evil_module:problem",
    "outside": "{outside}/evil.py:problem",
    "list": ["os", "abort"],
    "nul": "evil\0.py:problem",
    "escape": "evil\x1b[2J.py:problem",
}
TRACED = """
import json, sys
from paretoik.cli import main
met, codes = [], []
def hook(event, arguments):
    place = arguments[0].co_filename if event == "exec" else arguments[0] if event == "import" else ""
    if "evil" in place or "antigravity" in place:
        met.append(place)
sys.addaudithook(hook)
for words in {commands!r}:
    sys.argv = ["paretoik", *words]
    try:
        main()
    except SystemExit as end:
        codes.append(end.code or 0)
print(json.dumps([met, codes]))
"""
PROJECT = """
import paretoik as pk
from tests.api.problems import tracking

def motions() -> pk.Tracking:
    return tracking(velocity=6.0)
"""


def naming(run: Path, folder: Path, reference: object) -> Path:
    """Return a copy of a run that names another problem, with digests that a stranger could make."""
    front = pk.Front.load(run)
    provenance = {**front.provenance, "problem": reference}
    pk.Front(**{**{name: getattr(front, name) for name in COLUMNS}, "provenance": provenance}).save(folder)
    assert json.loads((folder / "run.json").read_text())["problem"] == reference
    return folder


COLUMNS = ("ids", "objectives", "names", "units", "maximised", "genes", "motions", "violation", "ranges")


@pytest.fixture
def project(run, tmp_path, monkeypatch):
    """A user's folder with a problem in a file, and a run of it."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "papers").mkdir()
    (tmp_path / "papers" / "users_motions.py").write_text(PROJECT)
    yield naming(run[0], tmp_path / "runs" / "first", "papers/users_motions.py:motions")
    sys.modules.pop("users_motions", None)


@pytest.fixture
def strangers(project, run, tmp_path, tmp_path_factory):
    """A project with runs that name foreign code; this writes a mark when it is run."""
    outside = tmp_path_factory.mktemp("outside")
    evil = EVIL.format(mark=str(outside / "mark"))
    for name, reference in HOSTILE.items():
        reference = reference.format(outside=outside) if isinstance(reference, str) else reference
        folder = naming(run[0], tmp_path / "runs" / name, reference)
        (folder / "evil.py").write_text(evil)
        shutil.copy(run[0] / RECORDING, folder)
    for file in (tmp_path / "evil.py", *(place / "evil.py" for place in (tmp_path / "runs", tmp_path.parent, outside))):
        file.write_text(evil)
    (outside / "evil_module.py").write_text(evil)
    (tmp_path / "papers" / "evil.py").symlink_to(outside / "evil.py")
    yield outside
    (tmp_path.parent / "evil.py").unlink()


def trace(commands: list[list[str]], outside: Path) -> tuple[list[str], list[int]]:
    """Run commands in one process; return the strangers' code that it imported or ran, and the exit codes."""
    environment = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    path = os.pathsep.join([str(ROOT), str(outside)])
    child = subprocess.run(
        [sys.executable, "-c", TRACED.format(commands=commands)],
        env=environment | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert child.returncode == 0, child.stderr  # nobody aborted it
    met, codes = json.loads(child.stdout.splitlines()[-1])
    assert len(codes) == len(commands)
    return met, codes


def test_nothing_that_a_strangers_run_names_is_imported_or_called(strangers):
    reading = [["select", f"runs/{name}", "--knee"] for name in HOSTILE]
    working = [["export", "--rate", "50"], ["navigate", "--point", "0", "--improve", "torque_norm"], ["resume"]]
    working += [["refine", "--out", "runs/refined"]]
    refused = [[verb, f"runs/{name}", *words] for verb, *words in working for name in HOSTILE]
    reading += [["report", "runs/within"], ["compare", "runs/python", "runs/module"], ["verify", "runs/current"]]
    reading += [["select", "runs/current", "--undo"]]
    met, codes = trace([*reading, *refused, ["show", "runs/within"]], strangers)
    assert (met, (strangers / "mark").exists()) == ([], False)
    assert codes == [0] * len(reading) + [2] * (len(refused) + 1)  # the viewer finds no screen


def test_what_a_user_names_is_loaded_and_only_a_problem_is_taken(strangers):
    names = ("runs/within/evil.py:value", "os:abort")
    met, codes = trace([["select", "runs/within", "--knee", "--problem", name] for name in names], strangers)
    assert any(place.endswith("within/evil.py") for place in met)
    assert codes == [2, 2]


def test_a_user_names_the_problem_by_its_text_or_as_an_object(project):
    with pytest.warns(
        RuntimeWarning, match=r"its file is run only if you name it: .*--problem papers/users_motions\.py"
    ):
        front = pk.load_front(project)
    assert not hasattr(front.motions, "torque")
    assert front.problem is None
    named = pk.load_front(project, "papers/users_motions.py:motions")
    assert pk.load_front(project, named.problem).motions.torque.shape == named.motions.torque.shape


def test_a_stranger_is_named_in_one_line_that_steers_no_terminal(strangers):
    with pytest.warns(RuntimeWarning) as warned:
        front = pk.load_front("runs/escape")
    (text,) = [str(each.message) for each in warned]
    assert "motions come without their arm" in text
    assert text.isprintable()
    assert np.isfinite(front.motions.q).all()


def on_a_terminal(words: list[str], answer: str) -> tuple[int, str]:
    """Run a command on a terminal and answer its question; return its exit code and its output."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execve(sys.executable, [sys.executable, "-m", "paretoik", *words], os.environ | {"PYTHONPATH": str(ROOT)})
    printed = b""
    with contextlib.suppress(OSError):  # which is how its end comes
        while content := os.read(terminal, 4096):
            printed += content
            if printed.endswith(b"[y/N] "):
                os.write(terminal, answer.encode() + b"\n")
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), printed.decode()


def test_on_a_terminal_the_user_is_asked_and_only_a_yes_runs_code(strangers, project):
    mark = strangers / "mark"
    code, printed = on_a_terminal(["report", "runs/current"], "n")
    assert (code, mark.exists()) == (0, False)
    assert f"runs/current is a run of evil.py:problem. Run the code of {Path.cwd() / 'evil.py'}?" in printed
    code, printed = on_a_terminal(["export", "runs/current", "--point", "0"], "")
    assert (code, mark.exists()) == (2, False)
    assert "export runs/current --point 0 --problem evil.py:problem" in " ".join(printed.split())
    code, _ = on_a_terminal(["report", "runs/current"], "y")
    assert (code, mark.exists()) == (2, True)  # it makes no problem
    code, printed = on_a_terminal(["export", "runs/first", "--point", "0"], "y")
    assert code == 0, printed
