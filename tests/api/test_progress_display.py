from __future__ import annotations

import pytest

from paretoik.api.progress import RunProgress, open_observer, progress_text, show_compilation
from paretoik.compilation_notices import CompilationNotice, announce

NOTICE = CompilationNotice(what="the planner", seconds=40.0)


def progress(done: int, **parts) -> RunProgress:
    return RunProgress(**{"stage": "generation", "done": done, "total": 10, "seconds": 30.0} | parts)


@pytest.mark.parametrize(
    ("shown", "limit", "text"),
    [
        (progress(5, summary="front 4"), None, "generation 5/10, front 4, at most 0:30 left"),
        (progress(1, stage="refinement"), None, "refinement 1/10, 0:30 so far"),
        (progress(1, stage="refinement", remaining=270.0), None, "refinement 1/10, about 4:30 left"),
        (progress(5), 40.0, "generation 5/10, at most 0:10 left"),
        (progress(5), 20.0, "generation 5/10, at most 0:00 left"),
        (progress(5, then="refinement"), None, "generation 5/10, at most 0:30 left, then refinement"),
        (progress(10, summary="front 4"), None, "generation 10/10, front 4, 0:30 so far"),
        (progress(10, then="refinement"), 20.0, "generation 10/10, 0:30 so far, then refinement"),
        (progress(5, stage="point", remaining=62.0, following="certification"), None, "point 5/10, about 1:02 left"),
        (
            progress(10, stage="point", remaining=62.0, summary="jumps searched", following="certification"),
            None,
            "point 10/10, jumps searched, 0:30 so far, then certification, about 1:02",
        ),
        (
            progress(10, stage="refinement", remaining=62.0, then="optimum", following="certification"),
            None,
            "refinement 10/10, 0:30 so far, then optimum",
        ),
        (progress(0, total=0, stage="saving"), None, "saving"),
        (progress(0), None, "generation 0/10, at most 5:00 left"),
    ],
)
def test_progress_is_a_line_with_the_time_left(shown, limit, text):
    assert progress_text(shown, limit) == text


def test_where_there_is_no_terminal_a_line_comes_now_and_then(capsys):
    with open_observer(True) as observe:
        observe(progress(1))
        observe(progress(2))
    assert capsys.readouterr().err == "generation 1/10, at most 4:30 left\n"


def test_quiet_means_no_observer_and_no_notices_of_compilation(capsys):
    with open_observer(False) as observe:
        assert observe is None
        announce(NOTICE)
    assert capsys.readouterr().err == ""


def test_by_default_a_terminal_gets_a_bar_and_nothing_else_is_drawn_on(monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    with open_observer(None) as observe:
        observe(progress(5, stage="refinement", remaining=30.0))
        announce(NOTICE)
    assert "compiling the planner" in capsys.readouterr().err
    mine = [].append
    with open_observer(mine) as observe:
        observe(progress(5))
    assert mine.__self__[-1].done == 5


def test_by_default_without_a_terminal_a_line_comes_once_a_minute_has_passed(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    with open_observer(None) as observe:
        announce(NOTICE)
        for seconds, done in ((1.0, 1), (59.0, 2), (61.0, 3), (62.0, 4), (122.0, 5)):
            now[0] = seconds
            observe(progress(done))
            observe(progress(0, total=0, stage="saving"))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [str(NOTICE), "generation 3/10, at most 1:10 left", "generation 5/10, at most 0:30 left"]


def test_what_is_compiled_is_a_line_at_once(capsys):
    with open_observer(True):
        announce(NOTICE)
    with open_observer(True) as observe, show_compilation(observe):
        observe(progress(1))
        announce(NOTICE)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [str(NOTICE), "generation 1/10, at most 4:30 left", str(NOTICE)]
