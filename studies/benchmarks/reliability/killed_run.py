"""A run of the command line that kills itself on the way: ``python -m studies.benchmarks.reliability.killed_run``.

Arguments are the folder of the run, "time" or "event", when, and those of ``paretoik``. "time" is seconds after the
run's folder is claimed; "event" the number of what the process does there to files: it opens, makes, renames, removes
one, or has one on the disk. The last line on stderr of one that comes to its end is JSON: its events and seconds.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

EVENTS = ("open", "os.mkdir", "os.rename", "os.rmdir", "os.remove", "os.truncate")


class Killer:
    """Kills this process at a moment; counts what is done to the files of a folder until then."""

    def __init__(self, folder: Path, kind: str, moment: float) -> None:
        self._folder, self._kind, self._moment = str(folder), kind, moment
        self._events, self._claimed = 0, 0.0
        self._synchronise = os.fsync
        sys.addaudithook(self._see)
        os.fsync = self._synchronised  # which raises no audit event
        atexit.register(self._tell)

    def _see(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event not in EVENTS or self._folder not in str(arguments[0]):
            return
        if not self._claimed and "run.json" in str(arguments[0]):
            self._claimed = time.monotonic()
            if self._kind == "time" and self._moment < threading.TIMEOUT_MAX:
                timer = threading.Timer(self._moment, self._kill)
                timer.daemon = True
                timer.start()
        self._count()

    def _synchronised(self, fd: Any) -> None:
        self._count()
        self._synchronise(fd)

    def _count(self) -> None:
        self._events += self._claimed > 0
        if self._kind == "event" and self._events >= self._moment:
            self._kill()

    def _tell(self) -> None:
        done = {"events": self._events, "seconds": time.monotonic() - self._claimed}
        print(json.dumps(done), file=sys.stderr)

    def _kill(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


def main(arguments: list[str]) -> None:
    """Run the command line, to be killed on the way."""
    from paretoik.cli.app import main as command_line

    folder, kind, moment, *command = arguments
    Killer(Path(folder), kind, float(moment))
    sys.argv = ["paretoik", *command]
    command_line()


if __name__ == "__main__":
    main(sys.argv[1:])
