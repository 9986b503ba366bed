"""Run folders may come from anybody: reading one loads and calls nothing that it names, unless that is the user's."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.run_problem import check_own
from paretoik.errors import InvalidInput
from paretoik.run_files import RECORDING

ROOT = Path(__file__).parents[2]
EVIL = "import pathlib\npathlib.Path({mark!r}).write_text('run')\ndef problem():\n    return None\nvalue = 3\n"
HOSTILE = {  # what runs name, by the runs' names
    "python": "os:abort",
    "within": "runs/within/evil.py:problem",
    "value": "runs/value/evil.py:value",
    "beside": "runs/evil.py:problem",
    "above": "../evil.py:problem",
    "link": "papers/evil.py:problem",
    "folder": "papers/evil:problem",
    "module": "evil_module:problem",
    "outside": "{outside}/evil.py:problem",
    "easter": "antigravity:geohash",
    "list": ["os", "abort"],
    "number": 3,
    "empty": "",
    "long": f"{'evil' * 2000}.py:problem",
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
    """Return a copy of a run that names another problem, with digests as a stranger would make them."""
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
    """A project with runs that name what is not the user's, all of which writes a mark where it is run."""
    outside = tmp_path_factory.mktemp("outside")
    evil = EVIL.format(mark=str(outside / "mark"))
    for name, reference in HOSTILE.items():
        reference = reference.format(outside=outside) if isinstance(reference, str) else reference
        folder = naming(run[0], tmp_path / "runs" / name, reference)
        (folder / "evil.py").write_text(evil)
        shutil.copy(run[0] / RECORDING, folder)
    for file in (tmp_path / "runs" / "evil.py", tmp_path.parent / "evil.py", outside / "evil.py"):
        file.write_text(evil)
    (outside / "evil_module.py").write_text(evil)
    (tmp_path / "papers" / "evil.py").symlink_to(outside / "evil.py")
    yield outside
    (tmp_path.parent / "evil.py").unlink()


def trace(commands: list[list[str]], outside: Path) -> tuple[list[str], list[int]]:
    """Run commands in one process; return what of the strangers' it imported or ran, and the exit codes."""
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
    reading += [["report", "runs/within"], ["compare", "runs/python", "runs/module"]]
    met, codes = trace([*reading, *refused, ["show", "runs/within"]], strangers)
    assert (met, (strangers / "mark").exists()) == ([], False)
    assert codes == [0] * len(reading) + [2] * (len(refused) + 1)  # the viewer finds no screen


def test_what_a_user_names_is_loaded_and_only_a_problem_is_taken(strangers):
    names = ("runs/within/evil.py:value", "os:abort")
    met, codes = trace([["select", "runs/within", "--knee", "--problem", name] for name in names], strangers)
    assert any(place.endswith("within/evil.py") for place in met)
    assert codes == [2, 2]


def test_the_projects_problem_is_loaded_unasked(project):
    assert pk.load_front(project).motions.torque.shape == pk.load_front(project).motions.q.shape


def test_a_problem_that_was_edited_since_leaves_the_run_its_positions(project):
    file = Path("papers/users_motions.py")
    file.write_text(file.read_text().replace("6.0", "6.5"))
    with pytest.warns(RuntimeWarning, match="come without their arm: .*got one whose fingerprint is another"):
        front = pk.load_front(project)
    assert len(front.motions) == len(front)
    with pytest.raises(InvalidInput, match="whose fingerprint is another"):
        pk.load_front(project, "papers/users_motions.py:motions")


def test_a_stranger_is_named_in_one_line_that_says_how_to_have_it(strangers):
    with pytest.warns(RuntimeWarning) as warned:
        front = pk.load_front("runs/escape")
    (text,) = [str(each.message) for each in warned]
    assert "motions come without their arm: " in text
    assert "problem=, or --problem FILE.py:NAME, loads one" in text
    assert "\x1b" not in text
    assert not hasattr(front.motions, "torque")
    assert np.isfinite(front.motions.q).all()


def test_a_run_of_another_scheme_says_that_another_version_made_it(run, problem, tmp_path):
    front = pk.Front.load(run[0])
    provenance = {**front.provenance, "fingerprint": "c0ffee" * 10}
    pk.Front(**{**{name: getattr(front, name) for name in COLUMNS}, "provenance": provenance}).save(tmp_path / "old")
    with pytest.raises(InvalidInput, match=r"a run of another version of paretoik.*whether it is of this problem"):
        pk.load_front(tmp_path / "old", problem)
    assert len(pk.load_front(tmp_path / "old")) == len(front)


def test_in_a_projects_folder_a_file_of_another_folder_than_the_runs_is_the_users(project):
    for run in ("runs/first", "elsewhere", "../elsewhere"):
        check_own(Path(run), "papers/users_motions.py:motions")
        check_own(Path(run), f"{Path('papers').resolve()}/users_motions.py:motions")
    with pytest.raises(InvalidInput, match="lies beside the run"):
        check_own(Path("papers/run"), "papers/users_motions.py:motions")


def test_whoever_is_in_a_runs_folder_is_in_no_project(project, run, monkeypatch):
    """A stranger's run may hold other runs, and a problem of theirs: all of it came together."""
    inner = naming(run[0], project / "inner", "evil.py:problem")
    naming(run[0], Path("elsewhere"), "runs/first/evil.py:problem")
    elsewhere = Path("elsewhere").resolve()
    for folder in (project, inner, project / "checkpoint"):
        folder.mkdir(exist_ok=True)
        (folder / "evil.py").write_text(EVIL.format(mark=str(elsewhere / "mark")))
    with pytest.raises(InvalidInput, match=r"lies beside the run|in a run's folder"):
        check_own(elsewhere, "runs/first/evil.py:problem")
    for folder in (project.resolve(), project.resolve() / "checkpoint"):
        monkeypatch.chdir(folder)
        for opened in (project.resolve(), inner.resolve(), elsewhere):
            with pytest.raises(InvalidInput, match=r"lies beside the run|in a run's folder"):
                check_own(opened, "evil.py:problem")
            with pytest.warns(RuntimeWarning, match="come without their arm"):
                pk.load_front(opened)
    assert not (elsewhere / "mark").exists()


@pytest.mark.parametrize("home", [".", "papers"])
def test_the_home_folder_and_those_above_are_no_project(project, monkeypatch, home):
    check_own(project, "papers/users_motions.py:motions")
    monkeypatch.setenv("HOME", str(Path(home).resolve()))
    with pytest.raises(InvalidInput, match="not below a project"):
        check_own(project, "papers/users_motions.py:motions")


def test_the_papers_problems_are_the_projects_from_its_root(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    for run in (ROOT / "runs" / "first", tmp_path / "first"):
        check_own(run, "problems/tringali_2020.py:energy_torque")
