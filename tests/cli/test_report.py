from __future__ import annotations

from tests.review.page_reading import Page


def test_report_writes_a_page_into_the_run_or_another_file(paretoik, finished, tmp_path):
    ended = paretoik("report", finished)
    assert (ended.code, ended.out) == (0, f"{finished / 'report.html'}\n")
    assert paretoik("report", finished, "--out", tmp_path / "mine.html").out == f"{tmp_path / 'mine.html'}\n"
    text = (tmp_path / "mine.html").read_text(encoding="utf-8")
    assert text == (finished / "report.html").read_text(encoding="utf-8")
    assert Page(text).data["motions"]["arm"]["planar"]
