from __future__ import annotations

from importlib import import_module

import pytest

import paretoik as pk
from paretoik.compilation_notices import CompilationNotice, begin_compilation, end_compilation
from paretoik.progress import RunProgress, count_observer, open_observer, progress_text
from tests.api.problems import tracking


def announce(notice: CompilationNotice) -> None:
    begin_compilation(notice)
    end_compilation()


def test_the_time_left_counts_later_stages_once_enough_is_done(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("paretoik.progress.computing_clock", lambda: clock[0])
    seen: list[RunProgress] = []
    show = count_observer(seen.append, "refinement", later=lambda: 0.5, uniform=True)
    for done in (1, 10, 20):
        clock[0] = 100.0 + 2.0 * done
        show(done, 20)
    assert [one.remaining for one in seen] == [None, 30.0, 10.0]
    count_observer(seen.append, "point")(10, 20)
    assert seen[-1].remaining is None


# By verb: the folder that it works in, its problem, its call, and its stages.
VERBS = {
    "plan": ("formulations.tracking", "find_optima", [pk.kinetic_energy], {"starts": 4}, {"sample"}),
    "epsilon_front": (
        "api.epsilon_front",
        "epsilon_points",
        [pk.kinetic_energy, pk.torque_norm],
        {"starts": 4, "points": 3},
        {"optimum", "point", "certification"},
    ),
    "refine": (
        "pareto.refined_front",
        "refine",
        [pk.kinetic_energy, pk.torque_norm],
        {},
        {"refinement", "certification"},
    ),
}


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_shows_what_it_compiles_and_all_its_stages(verb, monkeypatch, capsys):
    module, name, objectives, settings, stages = VERBS[verb]
    subject = problem = tracking(*objectives)
    if verb == "refine":
        subject = pk.solve(problem, population=8, generations=2, points=2)
    work = getattr(import_module(f"paretoik.{module}"), name)

    def compile_first(*args, **kwargs):
        announce(CompilationNotice(what="everything", seconds=9.0))
        return work(*args, **kwargs)

    monkeypatch.setattr(f"paretoik.{module}.{name}", compile_first)
    capsys.readouterr()  # what building the problem compiled
    seen: list[RunProgress] = []
    getattr(pk, verb)(subject, **settings, observe=lambda progress: bool(seen.append(progress)))
    assert {one.stage for one in seen} == {"compilation", *stages}
    assert capsys.readouterr().err == ""
    assert not any("left" in progress_text(one) for one in seen if 0 < one.total <= one.done)
    planned = dict.fromkeys(one.summary.partition(", ")[0] for one in seen if one.stage == "optimum")
    assert [*planned] == (["kinetic_energy (1 of 2)", "torque_norm (2 of 2)"] if "optimum" in stages else [])
    for stage in stages:
        last = [one for one in seen if one.stage == stage][-1]
        assert 0 < last.done <= last.total


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


def test_without_a_terminal_a_line_comes_now_and_then(capsys):
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
