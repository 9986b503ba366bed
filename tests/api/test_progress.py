from __future__ import annotations

from paretoik.api.progress import RunProgress, count_observer, show_compilation
from paretoik.compilation_notices import CompilationNotice, announce


def test_counts_become_the_progress_of_a_stage():
    seen: list[RunProgress] = []
    show = count_observer(seen.append, "point", lambda done, total: f"{total - done} to go")
    show(1, 3)
    show(2, 3)
    assert [(one.stage, one.done, one.total, one.summary) for one in seen] == [
        ("point", 1, 3, "2 to go"),
        ("point", 2, 3, "1 to go"),
    ]
    assert 0 <= seen[0].seconds <= seen[1].seconds
    assert seen[0].generation is None


def test_the_answer_of_an_observer_is_passed_on():
    assert count_observer(lambda progress: progress.done == 2, "point")(2, 3) is True


def test_what_is_compiled_is_a_stage():
    seen: list[RunProgress] = []
    with show_compilation(seen.append):
        announce(CompilationNotice(what="the planner", seconds=40.0))
    assert [(one.stage, one.total) for one in seen] == [("compilation", 0)]
    assert seen[0].summary.startswith("compiling the planner")


def test_without_an_observer_nothing_is_shown():
    assert count_observer(None, "point") is None
