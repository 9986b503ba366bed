"""Links that somebody plants at all file names of a run, while it runs or before it is resumed.

Nothing changes at their targets: no file, no content of a folder; and nothing new is made there.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.runs.file_replacement import SAVED
from paretoik.runs.files import CHECKPOINT, CHOICES, CONTENTS, FORMER, JOURNAL, RECORDING, RUN
from paretoik.runs.folder import LOCK, PART
from tests.api.problems import tracking
from tests.cli.commands import ROOT, start_process

pytestmark = pytest.mark.slow
NAMES = (*CONTENTS, LOCK, SAVED, FORMER, PART)
SMALL = {"population": 12, "generations": 4, "seed": 1}
PLANTER = """
import os, sys
from pathlib import Path
folder, elsewhere, *names = map(Path, sys.argv[1:])
targets = elsewhere / "folder", elsewhere / "file", elsewhere / "nothing"
process, count = os.getppid(), 0
while True:
    count += 1
    names_now = [*names, *(each.name for each in folder.glob(".*.[0-9]*"))] if folder.exists() else []
    for i, name in enumerate(names_now):
        place, spare = folder / name, folder / f"planted{count}"
        try:
            if place.is_dir() and not place.is_symlink():
                place.rename(folder / f"away{count}-{i}")
            spare.symlink_to(targets[(count + i) % 3])
            spare.replace(place)
        except OSError:
            spare.unlink(missing_ok=True)
"""


@pytest.fixture
def elsewhere(tmp_path):
    """A folder with a file, a folder with files of all names that a run writes, and an unused name."""
    place = tmp_path / "elsewhere"
    (place / "folder" / "source").mkdir(parents=True)
    for name in {*NAMES, JOURNAL, "reserve"}:
        (place / "folder" / name).write_bytes(b"precious")
    (place / "file").write_bytes(b"precious")
    return place


def contents(place: Path) -> dict[str, bytes | None]:
    return {str(file.relative_to(place)): file.read_bytes() if file.is_file() else None for file in place.rglob("*")}


def plant(folder: Path, name: str, target: Path) -> None:
    """Put a link in the place of a name, as anybody with write access can."""
    place = folder / name
    if place.is_dir() and not place.is_symlink():
        place.rename(folder.parent / f"away-{name}")
    place.unlink(missing_ok=True)
    place.symlink_to(target)


@pytest.mark.parametrize("kind", ["file", "folder", "nothing"])
@pytest.mark.parametrize("name", NAMES)
def test_a_link_planted_during_a_run_changes_nothing_that_it_leads_to(tmp_path, elsewhere, name, kind):
    before = contents(elsewhere)

    def observe(progress: pk.RunProgress) -> None:
        plant(tmp_path / "run", name, elsewhere / kind)

    with warnings.catch_warnings(action="ignore"):  # of views that could not be completed
        try:
            pk.solve(tracking(), **SMALL, out=tmp_path / "run", observe=observe)
        except InvalidInput as refusal:
            assert "\n" not in str(refusal)  # noqa: PT017
    assert contents(elsewhere) == before


@pytest.mark.parametrize("kind", ["file", "folder", "nothing"])
@pytest.mark.parametrize("name", NAMES)
def test_a_link_planted_before_a_run_goes_on_changes_nothing_that_it_leads_to(tmp_path, elsewhere, name, kind):
    folder = tmp_path / "run"
    pk.solve(tracking(), **SMALL, out=folder, time_limit=1e-6, observe=False)
    assert (folder / CHECKPOINT / JOURNAL).exists()
    before = contents(elsewhere)
    plant(folder, name, elsewhere / kind)
    with warnings.catch_warnings(action="ignore"):
        try:
            pk.resume(folder, tracking(), observe=False)
        except InvalidInput as refusal:
            assert "\n" not in str(refusal)  # noqa: PT017
    assert contents(elsewhere) == before


@pytest.fixture(scope="module")
def chosen(tmp_path_factory):
    """A run with its recording, and a choice."""
    folder = tmp_path_factory.mktemp("chosen") / "run"
    pk.solve(tracking(), **SMALL, out=folder, observe=False).select("compromise")
    return folder


@pytest.mark.parametrize("kind", ["file", "folder", "nothing"])
@pytest.mark.parametrize("name", [LOCK, SAVED, CHOICES, RECORDING])
def test_a_link_planted_before_a_choice_is_shown_changes_nothing_that_it_leads_to(
    tmp_path, elsewhere, chosen, name, kind
):
    """The lock of a run's folder is read before its recording is replaced."""
    folder = shutil.copytree(chosen, tmp_path / "run")
    recording = (folder / RECORDING).read_bytes()
    front, before = pk.load_front(folder, tracking()), contents(elsewhere)
    plant(folder, name, elsewhere / kind)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            front.select(pk.Weights(kinetic_energy=0.9, torque_norm=0.1))
        except InvalidInput as refusal:
            assert "\n" not in str(refusal)  # noqa: PT017
    assert contents(elsewhere) == before
    if name == LOCK:  # it is unknown whether another process works there
        assert any("the recording stays as it was" in str(each.message) for each in warned)
        assert (folder / RECORDING).read_bytes() == recording


@pytest.mark.parametrize("attempt", range(3))
def test_a_process_that_goes_on_planting_links_at_all_names_changes_nothing_elsewhere(tmp_path, elsewhere, attempt):
    before = contents(elsewhere)
    problem = "problems/tringali_2020.py:energy_torque"
    run = start_process("solve", problem, "--out", tmp_path / "run", "--population=20", "--generations=10")
    names = [name for name in NAMES if name != RUN or attempt]  # without run.json it is no run, and soon refused
    command = [sys.executable, "-c", PLANTER, str(tmp_path / "run"), str(elsewhere), *names]
    planter = subprocess.Popen(command, cwd=ROOT, env=os.environ)
    try:
        _, errors = run.communicate(timeout=300)
    finally:
        planter.kill()
        planter.wait()
    assert contents(elsewhere) == before
    assert run.returncode in (0, 2), errors
    assert "Traceback" not in errors
