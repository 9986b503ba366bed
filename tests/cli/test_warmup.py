"""``paretoik warmup`` solves a problem of every kind, and says what it compiled."""

from __future__ import annotations

import pytest

from paretoik.compilation_notices import begin_compilation, end_compilation


def kinds():
    begin_compilation()
    end_compilation("paretoik.nlp.kernel.step")
    yield "Tracking"


@pytest.mark.parametrize("quiet", [False, True])
def test_every_compiled_function_is_a_line_with_its_seconds(paretoik, monkeypatch, quiet):
    monkeypatch.setattr("paretoik.cli.app.solved_kinds", kinds)
    ended = paretoik("warmup", *(["--quiet"] if quiet else []))
    assert ended.code == 0
    assert ended.out.startswith("1 functions compiled in 0 s")
    assert ended.err.splitlines() == ([] if quiet else ["nlp.kernel.step: 0.0 s", "Tracking is ready"])


@pytest.mark.slow
def test_a_second_warmup_compiles_nothing(paretoik):
    assert paretoik("warmup", "--quiet").code == 0
    assert paretoik("warmup", "--quiet").out.startswith("0 functions compiled")
