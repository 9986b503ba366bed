from __future__ import annotations

from tests.cli.commands import ROOT, Ended, strict


def test_list_shows_each_problem_with_what_it_is(paretoik, monkeypatch):
    monkeypatch.chdir(ROOT)
    ended = paretoik("list")
    names = [line.split()[0] for line in ended.out.splitlines()]
    assert ended.code == 0
    assert {"problems/tringali_2020.py:energy_torque", "problems/panda.py:across_the_table"} <= set(names)
    assert all(len(line.split()) > 3 for line in ended.out.splitlines())


def test_list_prints_documentation_as_it_is_written(paretoik, mine):
    assert f"{mine}:good        [bold]Good[/bold] for tests." in paretoik("list", mine).out


def test_functions_that_may_be_problems_are_named_with_what_lists_them(paretoik, mine):
    ended = paretoik("list", mine)
    assert ended.err == (
        f"note: {mine} has functions that do not say what they return and may be problems too: tracking; "
        "an annotation, as -> Tracking, lists them\n"
    )


def test_a_file_that_cannot_be_listed_does_not_hide_the_others(paretoik, mine, tmp_path):
    (tmp_path / "torn.py").write_text("def f(:")
    ended = paretoik("list", tmp_path / "torn.py", mine, "--json")
    assert ended.code == 2
    assert [line.split()[0] for line in ended.err.splitlines()] == ["note:", "error:"]
    assert {"problem": f"{mine}:good", "about": "[bold]Good[/bold] for tests."} in strict(ended.out)


def test_list_without_any_file_says_where_it_looked(paretoik, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert paretoik("list") == Ended(
        2, "", f"error: list: wanted a file, got none, and there is no problems/*.py in {tmp_path}\n"
    )
