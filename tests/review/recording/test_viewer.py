"""Rerun's programs run without telemetry: they write nothing into the user's home and contact nobody."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr

from paretoik.review.recording.viewer import private_environment, run_viewer
from tests.traces import trace

HOMES = {"XDG_CONFIG_HOME": ".config", "XDG_DATA_HOME": ".local/share", "XDG_CACHE_HOME": ".cache"}


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    """Return the empty home of a user without a screen, whose environment asks for telemetry."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in (*HOMES, "CI", "DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    return folder


@pytest.fixture
def recording(tmp_path) -> Path:
    file = tmp_path / "small.rrd"
    stream = rr.RecordingStream("small")
    stream.save(file)
    stream.log("point", rr.Points2D([[0.0, 0.0]]))
    stream.disconnect()
    return file


def verify(file: Path, environment: dict[str, str] | None) -> None:
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(file)]
    subprocess.run(command, env=environment, check=True, capture_output=True)


def test_rerun_writes_nothing_into_the_users_home(home, recording):
    with private_environment() as environment:
        assert "FORCE_RERUN_ANALYTICS" not in environment
        folder = Path(environment["XDG_CONFIG_HOME"])
        before = (folder / "rerun" / "analytics.json").read_text()
        for _ in range(2):
            verify(recording, environment)
        assert (folder / "rerun" / "analytics.json").read_text() == before
        assert not list((folder / "analytics").iterdir())
    assert not folder.exists()
    assert not list(home.iterdir())


def test_the_viewer_writes_nothing_into_the_users_home(home, recording):
    run_viewer(str(recording))  # and ends, because there is no screen
    assert not list(home.iterdir())


def test_rerun_looks_nothing_up_and_sends_nothing(home, recording, tmp_path):
    command = sys.executable, "-m", "rerun", "rrd", "verify", recording
    with private_environment() as environment:
        for _ in range(2):  # a first session never sends anything
            seen = trace(tmp_path / "calls", *command, folder=tmp_path, environment=environment)
            assert not seen.ended.returncode
            assert not seen.addresses
            assert not seen.look_ups()
