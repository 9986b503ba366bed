""""""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.files import (
    CHOICES,
    PAGE_MARK,
    PICTURE_MARK,
    RUN,
    check_target,
    digest,
    is_run,
    read_arrays,
    read_run,
    to_json,
    write_run,
)


def test_a_run_is_read_as_it_was_written_with_its_format_and_its_digest(tmp_path):
    write_run(tmp_path, {"status": "running", "seed": 3})
    run = read_run(tmp_path / RUN)
    assert {name: run[name] for name in ("format", "status", "seed")} == {"format": 1, "status": "running", "seed": 3}
    assert run["digest"] == digest(run)
    assert digest(run | {"seed": 4}) != run["digest"]


def test_a_run_of_another_format_is_one_but_cannot_be_read(tmp_path):
    (tmp_path / RUN).write_text('{"format": 2}')
    assert is_run(tmp_path / RUN)
    with pytest.raises(InvalidRun, match="must have format 1, got 2; use another version of paretoik"):
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
    with pytest.raises(InvalidInput, match=r"run\.settings\[1\] must be JSON data, got object"):
        to_json({"settings": [1, object()]})


@pytest.mark.parametrize("name", [".", "..", "/", "x" * 300, "taken/page.html", "notes.txt", RUN, CHOICES])
def test_where_nobody_may_write_is_known_before_any_work(tmp_path, name):
    (tmp_path / "taken").touch()
    (tmp_path / "notes.txt").write_text("mine")
    write_run(tmp_path, {"status": "done"})
    with pytest.raises(InvalidInput) as refused:
        check_target("report", tmp_path / name, mark=PAGE_MARK)
    assert "\n" not in str(refused.value)


def test_a_page_may_be_written_anew_and_other_files_where_told(tmp_path):
    page, notes = tmp_path / "report.html", tmp_path / "notes.html"
    page.write_bytes(b"<!doctype html>" + PAGE_MARK)
    notes.write_text("<!doctype html>mine")
    write_run(tmp_path, {"status": "done"})
    check_target("report", page, mark=PAGE_MARK)
    check_target("report", notes, mark=PAGE_MARK, overwrite=True)
    check_target("report", tmp_path / "new" / "report.html", mark=PAGE_MARK)
    for file, mark in ((notes, PAGE_MARK), (page, PICTURE_MARK), (page, None)):
        with pytest.raises(InvalidInput, match="use --overwrite"):
            check_target("report", file, mark=mark)
    with pytest.raises(InvalidInput, match="must not be one of the run's own files"):
        check_target("report", tmp_path / RUN, mark=PAGE_MARK, overwrite=True)


def test_nothing_in_an_archive_is_unpickled():
    sink = io.BytesIO()
    np.savez(sink, a=np.array([print]))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        read_arrays(sink.getvalue())
