from __future__ import annotations

import sys
from pathlib import Path

import pytest

from paretoik.cli import main
from tests.cli.commands import MINE, SMALL, Ended


@pytest.fixture(autouse=True)
def agreeing(monkeypatch):
    """Say yes to the question whether the code of a run's problem may be run."""
    monkeypatch.setattr("paretoik.cli.console.has_agreed", lambda _: True)


@pytest.fixture
def paretoik(capsys, monkeypatch):
    """Run the command line within this process."""

    def run(*words: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["paretoik", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return Ended(int(ended.value.code or 0), said.out, said.err)

    return run


@pytest.fixture(scope="session")
def mine(tmp_path_factory):
    file = tmp_path_factory.mktemp("users") / "users_own_problems.py"
    file.write_text(MINE)
    return str(file)


@pytest.fixture(scope="session")
def finished(tmp_path_factory, mine):
    """A finished run, only to be read."""
    out = tmp_path_factory.mktemp("runs") / "finished"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["paretoik", "solve", f"{mine}:good", "--out", str(out), *SMALL, "--quiet"])
        with pytest.raises(SystemExit) as ended:
            main()
    assert not ended.value.code
    return out
