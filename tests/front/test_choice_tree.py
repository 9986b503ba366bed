"""Choices kept in a run folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.front.choice_tree import read_choices
from paretoik.front.front import Front
from paretoik.front.preferences import Bounds, Weights
from paretoik.runs.files import CHOICES

ROOT = Path(__file__).parents[2]
GROWING = """
import sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from paretoik.front.front import Front

front, count = Front.load(sys.argv[1]), 0
print("loaded", flush=True)
while not Path(sys.argv[2]).exists():
    count += 1
    ids, objectives = np.append(front.ids, 100 + count), np.vstack([front.objectives, [[6.0 + count, 50.0 + count]]])
    front = replace(front, ids=ids, objectives=objectives, motions=None, genes=None, violation=None)
    front.save(sys.argv[1])
"""
SELECTING = """
import sys, warnings
from paretoik.errors import InvalidInput
from paretoik.front.front import Front

front = Front.load(sys.argv[1])
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    print(front.select(20).id, *(warning.message for warning in caught))
try:
    front.undo()
except InvalidInput as refused:
    print(refused)
"""
WITHOUT_PRIVILEGES = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"]  # with these root may write everywhere


@pytest.fixture
def kept(front, tmp_path) -> Front:
    front.save(tmp_path / "run")
    return front


def test_choices_are_a_tree_and_going_back_deletes_nothing(kept):
    first, second = kept.select({"energy": 1.0}), kept.select({"reach": 1.0})
    assert kept.undo().id == first.id
    third = kept.select("compromise")
    choices = Front.load(kept.folder).choices
    assert [(entry.parent, entry.point) for entry in choices.entries] == [
        (None, first.id),
        (1, second.id),
        (1, third.id),
    ]
    assert choices.current == 3
    assert choices.chosen.reason == third.reason
    assert choices.chosen.objectives == dict(zip(kept.names, third.objectives.tolist(), strict=True))
    assert len(repr(choices).splitlines()) == 3


def test_a_preference_is_kept_as_data_in_strict_json(kept):
    kept.select(Bounds(energy=(None, 4.0), then=Weights(reach=1.0)))
    content = json.loads((kept.folder / CHOICES).read_text(), parse_constant=pytest.fail)
    preference = content["entries"][0]["preference"]
    assert (preference["type"], preference["bounds"]) == ("Bounds", {"energy": [None, 4.0]})
    assert (preference["then"]["type"], preference["then"]["weights"]) == ("Weights", {"reach": 1.0})


def test_a_damaged_file_of_choices_is_refused_in_one_line(kept):
    kept.select({"energy": 1.0})
    file = kept.folder / CHOICES
    content = file.read_bytes()
    for place in range(0, len(content), 37):
        for damaged in (content[:place], content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]):
            file.write_bytes(damaged)
            with pytest.raises(InvalidRun, match=CHOICES) as refused:
                read_choices(kept.folder)
            assert "\n" not in str(refused.value)


def test_a_run_that_was_replaced_gets_no_choice_of_the_former_front(front, kept):
    other = replace(front, objectives=front.objectives * [2.0, 1.0])
    with pytest.raises(InvalidInput, match="got one with another run"):
        other.save(kept.folder)
    other.save(kept.folder, overwrite=True)
    with pytest.warns(RuntimeWarning, match="the choice is not kept"):
        kept.select({"energy": 1.0})
    assert not (kept.folder / CHOICES).exists()


def test_saving_into_its_own_folder_keeps_the_choices_and_losing_points_is_refused(kept):
    kept.select({"energy": 1.0})
    Front.load(kept.folder).save(kept.folder)
    assert len(kept.choices) == 1
    with pytest.raises(InvalidInput, match="points that this front does not have"):
        kept.where(energy=(None, 2.0)).save(kept.folder)


def test_no_choice_is_lost_while_another_process_saves_points_into_the_run(kept, tmp_path):
    end = tmp_path / "end"
    command = [sys.executable, "-c", GROWING, str(kept.folder), str(end)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as saving:
        try:
            assert saving.stdout.readline() == "loaded\n"
            for count in range(40):
                kept.select([10, 20, 30][count % 3])
            assert saving.poll() is None
        finally:
            end.touch()
    grown = Front.load(kept.folder)
    assert len(grown) > len(kept)
    assert len(grown.choices) == 40


def test_a_folder_that_cannot_be_written_keeps_no_choice_and_the_choice_is_made(kept):
    if os.getuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("root can write everywhere")
    kept.select(10)
    kept.folder.chmod(0o555)
    prefix = WITHOUT_PRIVILEGES if os.getuid() == 0 else []
    command = [*prefix, sys.executable, "-c", SELECTING, str(kept.folder)]
    lines = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    kept.folder.chmod(0o755)
    refusal = f"{kept.folder / CHOICES} must be writable, got Permission denied"
    assert lines == [f"20 the choice is not kept: {refusal}", refusal]
    assert len(kept.choices) == 1
