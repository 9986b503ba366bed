from __future__ import annotations

import os
import subprocess

import pytest

from paretoik.cli.show import show
from paretoik.errors import InvalidInput


@pytest.fixture
def viewer(monkeypatch):
    """Stand in for the viewer and keep the command it was started with."""
    started = {}

    def run(command, **settings):
        started.update(command=command, env=settings["env"])
        return subprocess.CompletedProcess(command, started.get("status", 0), stderr=started.get("said", ""))

    monkeypatch.setattr(subprocess, "run", run)
    return started


def test_the_recording_is_opened_on_this_machine_only(viewer, tmp_path):
    (tmp_path / "review.rrd").touch()
    show(tmp_path)
    command = viewer["command"]
    assert str(tmp_path / "review.rrd") in command
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert command[command.index("--port") + 1] == "auto"
    assert viewer["env"]["XDG_CONFIG_HOME"] != os.environ.get("XDG_CONFIG_HOME")


@pytest.mark.parametrize(
    ("said", "cause"),
    [
        ("", "exit status 1"),
        ("Error: winit: could not open a window\n", "could not open a window"),
        ("first\nNo module named rerun\n", "No module named rerun"),
    ],
)
def test_a_viewer_that_does_not_start_says_what_to_do(viewer, tmp_path, said, cause):
    (tmp_path / "review.rrd").touch()
    viewer.update(status=1, said=said)
    with pytest.raises(InvalidInput, match=f"got '{cause}'; without a screen, copy the file") as refusal:
        show(tmp_path)
    assert refusal.value.exit_code == 2


def test_a_run_without_recording_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"review\.rrd: wanted a recording, got nothing"):
        show(tmp_path)
