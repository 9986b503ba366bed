from __future__ import annotations

import os

import pytest

from paretoik.errors import InvalidInput
from paretoik.files import replace_file


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
