from __future__ import annotations

from tests.cli.commands import strict
from tests.review.page_reading import Page


def test_report_writes_a_page_into_the_run_or_another_file(paretoik, finished, tmp_path):
    ended = paretoik("report", finished)
    assert (ended.code, ended.out) == (0, f"{finished / 'report.html'}\n")
    assert paretoik("report", finished, "--out", tmp_path / "mine.html").out == f"{tmp_path / 'mine.html'}\n"
    text = (tmp_path / "mine.html").read_text(encoding="utf-8")
    assert text == (finished / "report.html").read_text(encoding="utf-8")
    assert Page(text).data["motions"]["arm"]["planar"]


def test_a_page_replaces_a_page_and_nothing_else_unless_told(paretoik, finished, tmp_path):
    notes, run = tmp_path / "notes.html", (finished / "run.json").read_bytes()
    notes.write_text("mine")
    words = "report", finished, "--out"
    for file in (notes, finished / "run.json", finished / "front.png", tmp_path / ("x" * 300)):
        ended = paretoik(*words, file)
        assert (ended.code, ended.out) == (2, "")
        assert len(ended.err.strip().splitlines()) == 1
    assert paretoik(*words, finished / "run.json", "--overwrite").code == 2
    assert (notes.read_text(), (finished / "run.json").read_bytes()) == ("mine", run)
    assert paretoik(*words, notes, "--overwrite").code == 0
    assert strict(paretoik(*words, notes, "--json").out) == {"out": str(notes)}
