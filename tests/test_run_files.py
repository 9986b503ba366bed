from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.run_files import RUN, digest, is_run, read_run, replace_file, to_json, write_run


def test_a_run_is_read_as_it_was_written_with_its_format_and_its_digest(tmp_path):
    write_run(tmp_path, {"status": "running", "seed": 3})
    run = read_run(tmp_path / RUN)
    assert {name: run[name] for name in ("format", "status", "seed")} == {"format": 1, "status": "running", "seed": 3}
    assert run["digest"] == digest(run)
    assert digest(run | {"seed": 4}) != run["digest"]


def test_a_run_of_another_format_is_one_but_cannot_be_read(tmp_path):
    (tmp_path / RUN).write_text('{"format": 2}')
    assert is_run(tmp_path / RUN)
    with pytest.raises(InvalidRun, match="wanted format 1, got 2; it needs another version of paretoik"):
        read_run(tmp_path / RUN)


def test_what_a_run_says_becomes_strict_json(tmp_path):
    said = {
        "array": np.array([1.0, np.nan, -np.inf]),
        3: (np.int64(2), True, None),
        "file": Path("a/b"),
        "x": np.float64(1),
    }
    assert to_json(said) == {"array": [1.0, None, None], "3": [2, True, None], "file": "a/b", "x": 1.0}
    write_run(tmp_path, said)
    assert json.loads((tmp_path / RUN).read_text(), parse_constant=pytest.fail)["array"] == [1.0, None, None]


def test_what_json_cannot_hold_is_refused_by_its_place():
    with pytest.raises(InvalidInput, match=r"run\.settings\[1\]: wanted what JSON can hold, got object"):
        to_json({"settings": [1, object()]})


def test_a_file_is_replaced_and_nothing_else_stays_behind(tmp_path):
    file = tmp_path / "deep" / "run.json"
    replace_file(file, b"before")
    replace_file(file, b"after")
    assert file.read_bytes() == b"after"
    assert [entry.name for entry in file.parent.iterdir()] == ["run.json"]


def test_a_full_disk_leaves_the_former_file_whole(tmp_path, monkeypatch):
    replace_file(tmp_path / "run.json", b"before")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InvalidInput, match=r"run\.json: wanted to write it, got No space left on device"):
        replace_file(tmp_path / "run.json", b"after")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("run.json", b"before")]


def test_a_file_where_a_folder_should_be_is_refused(tmp_path):
    (tmp_path / "taken").write_text("text")
    with pytest.raises(InvalidInput, match="wanted to write it, got"):
        replace_file(tmp_path / "taken" / "run.json", b"content")
    assert (tmp_path / "taken").read_text() == "text"
