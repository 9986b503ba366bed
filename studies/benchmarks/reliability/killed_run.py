"""A run of the command line that kills itself: ``python -m studies.benchmarks.reliability.killed_run``.

Arguments are the folder of the run, a phase, an amount of it, and those of ``paretoik``. From the moment when the
folder is claimed, the stack of the main thread is read every few milliseconds: it is in "ask", "evaluate", "refine" or
"else", whose amounts are seconds. The amount of "write", "rename" and "fsync" is the number of these calls on files of
that folder; a write to a journal is killed halfway. The last line on stderr is JSON: what the journal does not have yet
[s], or the amounts of every phase and digests of all entries of the journal.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from types import FrameType
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from paretoik.api.initial import INITIAL
from paretoik.runs.journal import Journal

FilePhase: TypeAlias = Literal["write", "rename", "fsync"]  # in numbers; the others in seconds
Phase: TypeAlias = Literal["ask", "evaluate", "refine", "else", "write", "rename", "fsync"]

PHASES: tuple[Phase, ...] = get_args(Phase)
FILE_PHASES: tuple[FilePhase, ...] = get_args(FilePhase)
INTERVAL = 0.002  # s between looks at the stack
EVALUATION, STEPS = ("evaluate_candidates", "evaluate_again"), "closed_loop/step_evolution.py"
SEARCH = "search/ask_tell.py", "search/islands.py"
REFINEMENT = "paretoik/pareto/", "paretoik/trajectory/", "paretoik/nlp/"
CHANGES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Killer:
    """Kills this process after an ``amount`` of a phase of the run in a folder."""

    def __init__(self, folder: Path, phase: Phase, amount: float) -> None:
        self._folder, self._phase, self._amount = str(folder), phase, amount
        self._amounts = Counter[str]()
        self._entries: dict[str, str] = {}  # digests of the journal's values by key
        self._results = 0  # entries in addition to the run's start
        self._claimed = self._unsaved = 0.0  # time when the folder was claimed; seconds of work since the last entry
        self._main = threading.main_thread().ident
        self._synchronise, self._write = os.fsync, os.pwrite
        sys.addaudithook(self._see)
        os.fsync, os.pwrite = self._synchronised, self._written  # type: ignore[assignment]  # which raise no audit events
        self._watch_journals()
        atexit.register(self._tell)

    def _see(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self._folder not in str(arguments[:1]):
            return
        if not self._claimed and "run.json" in str(arguments[0]):
            self._claimed = time.monotonic()
            threading.Thread(target=self._look, daemon=True).start()
        if event == "os.rename":
            self._count("rename")
        elif event in ("os.mkdir", "os.truncate", "os.remove") or (event == "open" and _changes(*arguments[1:])):
            self._count("write")

    def _synchronised(self, fd: Any) -> None:
        self._count("fsync")
        self._synchronise(fd)

    def _written(self, descriptor: int, content: bytes, offset: int) -> int:
        if self._is_due("write"):
            self._write(descriptor, content[: len(content) // 2], offset)
        self._count("write")
        return self._write(descriptor, content, offset)

    def _is_due(self, phase: FilePhase) -> bool:
        return self._claimed > 0 and phase == self._phase and self._amounts[phase] + 1 >= self._amount

    def _count(self, phase: FilePhase) -> None:
        if self._is_due(phase):
            self._kill()
        self._amounts[phase] += self._claimed > 0

    def _look(self) -> None:
        """Add the time to the main thread's phase, and kill it there."""
        before = time.monotonic()
        while threading.main_thread().is_alive():
            time.sleep(INTERVAL)
            phase, now = _phase_of(sys._current_frames().get(self._main or 0)), time.monotonic()
            self._amounts[phase] += now - before  # type: ignore[assignment]  # seconds
            self._unsaved += 0.0 if phase == "else" else now - before
            before = now
            if phase == self._phase and self._amounts[phase] >= self._amount:
                self._kill()

    def _watch_journals(self) -> None:
        """Record the digest of every entry taken from a journal or put there, and the time of the last."""
        get, append = Journal.get, Journal.append

        def get_watched(journal: Journal, key: bytes) -> dict[str, np.ndarray] | None:
            values = get(journal, key)
            self._note(key, values)
            return values

        def append_watched(journal: Journal, key: bytes, values: Mapping[str, np.ndarray]) -> None:
            append(journal, key, values)
            self._note(key, values)

        Journal.get, Journal.append = get_watched, append_watched  # type: ignore[method-assign, assignment]

    def _note(self, key: bytes, values: Mapping[str, np.ndarray] | None) -> None:
        if values is None:
            return
        self._unsaved = 0.0
        self._results += key != INITIAL
        if "rows" not in values:  # parts of a generation, whose sizes depend on timing
            digest = sha256()
            for name in sorted(values):
                digest.update(name.encode() + np.ascontiguousarray(values[name]).tobytes())
            self._entries[key.hex()] = digest.hexdigest()[:16]

    def _tell(self) -> None:
        done = {"amounts": self._amounts, "entries": self._entries}
        print(json.dumps(done | {"seconds": time.monotonic() - self._claimed}), file=sys.stderr)

    def _kill(self) -> None:
        done = {"unsaved": self._unsaved, "results": self._results}
        os.write(2, f"\n{json.dumps(done)}\n".encode())
        os.kill(os.getpid(), signal.SIGKILL)


def _phase_of(frame: FrameType | None) -> Phase:
    """Return the phase of a stack, by the outermost function that tells it."""
    phase: Phase = "else"
    while frame is not None:
        file = frame.f_code.co_filename
        if file.endswith(STEPS) or frame.f_code.co_name in EVALUATION:
            phase = "evaluate"
        elif file.endswith(SEARCH) and frame.f_code.co_name == "ask":
            phase = "ask"
        elif any(folder in file for folder in REFINEMENT):
            phase = "refine"
        frame = frame.f_back
    return phase


def _changes(mode: str | None, flags: int) -> bool:
    return any(letter in (mode or "") for letter in "wxa+") or bool(flags & CHANGES)


def main(arguments: list[str]) -> None:
    """Run the command line, to be killed on the way."""
    from paretoik.cli.app import main as command_line

    folder, phase, amount, *command = arguments
    Killer(Path(folder), get_args(Phase)[get_args(Phase).index(phase)], float(amount))
    sys.argv = ["paretoik", *command]
    command_line()


if __name__ == "__main__":
    main(sys.argv[1:])
