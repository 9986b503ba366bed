"""A running run can be watched: only on this machine, and whatever happens to the viewer."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from paretoik.review.recording.recorder import Generation, Recorder, SearchedFront
from paretoik.review.recording.viewer import private_environment
from tests.review.reading import read, rows

SCENE = SearchedFront(names=("a", "b"), units=("", ""), maximised=(False, False))


def generation(number: int) -> Generation:
    F = np.array([[1.0, 3.0 - 0.01 * number], [2.0, 2.0 - 0.01 * number], [3.0 - 0.01 * number, 1.0]])
    return Generation(number=number, population=F + 0.5, front=F, front_ids=np.arange(3))


@pytest.fixture
def without_screen(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)


def live_recorder(file: Path) -> tuple[Recorder, str]:
    """Return a recorder of a live run without a screen, and the announced address."""
    notices: list[str] = []
    recorder = Recorder(file, title="live", scene=SCENE, live=True, notify=notices.append)
    recorder.record(generation(1))
    until = time.monotonic() + 60.0
    while not notices and time.monotonic() < until:
        recorder._process.pump()
        time.sleep(0.05)
    (notice,) = notices
    (address,) = re.findall(r"`rerun (\S+)`", notice)
    return recorder, address


def listening(port: int) -> set[str]:
    """Return the local addresses, in hexadecimal, of programs that listen on a port."""
    tables = [Path("/proc/net/tcp"), Path("/proc/net/tcp6")]
    if not tables[0].exists():
        pytest.skip("the system does not list who listens")
    lines = [line.split() for table in tables if table.exists() for line in table.read_text().splitlines()[1:]]
    return {line[1].split(":")[0] for line in lines if line[3] == "0A" and int(line[1].split(":")[1], 16) == port}


def test_without_a_screen_a_line_says_where_to_attach_and_only_this_machine_can(without_screen, tmp_path):
    recorder, address = live_recorder(tmp_path / "review.rrd")
    port = int(re.findall(r":(\d+)/", address)[0])
    assert address.startswith("rerun+http://127.0.0.1:")
    assert listening(port) == {"0100007F"}
    recorder.close()
    assert not listening(port)
    assert sorted(rows(read(tmp_path / "review.rrd")["/search/front"], "generation", "F")) == [1]


@pytest.mark.slow  # starts two programs of Rerun
def test_a_killed_viewer_does_no_harm_and_another_one_sees_earlier_data(without_screen, tmp_path):
    recorder, address = live_recorder(tmp_path / "review.rrd")
    saved, longest = tmp_path / "saved.rrd", 0.0
    watch = [sys.executable, "-m", "rerun", address, "--headless", "--bind", "127.0.0.1", "--port", "auto"]
    with private_environment() as environment:
        viewers = [
            subprocess.Popen(
                [*watch, *extra],
                env=environment,
                stderr=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,  # the viewer is a program that the command starts
            )
            for extra in ([], ["--save", str(saved)])
        ]
        try:
            for number in range(2, 60):
                started = time.process_time()
                recorder.record(generation(number))
                longest = max(longest, time.process_time() - started)
                time.sleep(0.05)
                if number == 40:
                    os.killpg(viewers[0].pid, signal.SIGKILL)
            until = time.monotonic() + 60.0
            while not (saved.exists() and saved.stat().st_size > 10_000) and time.monotonic() < until:
                recorder._process.pump()
                time.sleep(0.1)
        finally:
            for viewer in viewers:
                with suppress(ProcessLookupError):
                    os.killpg(viewer.pid, signal.SIGKILL)
                viewer.wait()
    recorder.close()
    assert longest < 0.1
    assert saved.stat().st_size > 10_000  # logged before it came
    assert sorted(rows(read(tmp_path / "review.rrd")["/search/front"], "generation", "F")) == list(range(1, 60))


def test_a_screen_that_does_not_answer_gives_a_notice_and_the_run_continues(tmp_path, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    recorder, address = live_recorder(tmp_path / "review.rrd")
    assert address.startswith("rerun+http://127.0.0.1:")
    recorder.record(generation(2))
    recorder.close()
    assert sorted(rows(read(tmp_path / "review.rrd")["/search/front"], "generation", "F")) == [1, 2]
