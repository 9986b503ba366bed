"""The largest resident memory of a run and of its recording process, watched from outside until both end."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from studies.benchmarks.checkouts import ROOT

PROCESSES = Path("/proc")  # Linux
RECORDER = "paretoik.review.recording_child"
INTERVAL = 0.01  # s between looks; each reads the peak so far, so only growth in the last interval is missed


@dataclass(kw_only=True)
class PeakMemory:
    """The largest resident memory [bytes] of the ``run`` itself and of its ``recorder``, 0 without one."""

    run: int = 0
    recorder: int = 0


def run_watched(command: Sequence[str]) -> tuple[str, PeakMemory]:
    """Run a command at the root of this checkout; return its output and its peaks.

    Raises subprocess.CalledProcessError if the command fails.
    """
    peak = PeakMemory()
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:  # an unread pipe would fill up
        child = subprocess.Popen(command, cwd=ROOT, stdout=output)
        while child.poll() is None:
            peak.run = max(peak.run, _peak_of(child.pid))
            for other in _children(child.pid):
                if RECORDER in _command_line(other):
                    peak.recorder = max(peak.recorder, _peak_of(other))
            time.sleep(INTERVAL)
        if child.returncode:
            raise subprocess.CalledProcessError(child.returncode, command)
        output.seek(0)
        return output.read(), peak


def _peak_of(process: int) -> int:
    """Return the largest resident memory of a process so far [bytes], 0 after its end."""
    with suppress(OSError, ValueError):
        _, _, peak = (PROCESSES / str(process) / "status").read_text().partition("VmHWM:")
        return 1024 * int(peak.split(maxsplit=1)[0]) if peak else 0
    return 0


def _children(process: int) -> list[int]:
    """Return the processes that a process has started, from any of its threads."""
    children = list[int]()
    with suppress(OSError):
        for thread in (PROCESSES / str(process) / "task").iterdir():
            with suppress(OSError):
                children += [int(child) for child in (thread / "children").read_text().split()]
    return children


def _command_line(process: int) -> str:
    """Return the command line of a process, empty after its end."""
    with suppress(OSError):
        return (PROCESSES / str(process) / "cmdline").read_text(errors="replace").replace("\0", " ")
    return ""
