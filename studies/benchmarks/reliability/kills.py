"""Runs of the command line killed at moments spread over their whole length, and what they come to when they go on."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow.parquet as pq

from paretoik.file_replacement import without_writers
from paretoik.run_files import CHECKPOINT, JOURNAL, MOTIONS, OPTIMA, RUN, TABLE, can_resume
from studies.benchmarks.checkouts import ROOT

Kind = Literal["time", "event"]
Outcome = Literal["nothing yet", "whole", "went on", "refused", "another result"]

ENERGY_TORQUE = "problems/tringali_2020.py:energy_torque"
COMMANDS: dict[str, tuple[str, ...]] = {
    "search": ("solve", ENERGY_TORQUE, "--population=60", "--generations=40", "--seed=1"),
    "search and refinement": (
        *("solve", ENERGY_TORQUE, "--refine", "--population=40"),
        *("--generations=12", "--points=8", "--seed=1"),
    ),
    "plan": ("plan", "problems/tringali_2020.py:simulation_2", "--starts=24"),
    "front": ("front", ENERGY_TORQUE, "--points=6", "--starts=12"),
    "refinement": ("refine", "SEARCH"),
    "closed loop": ("solve", "problems/marcos_2012.py:circle_3r", "--generations=10", "--population=20"),
}
"""What is run, by name; SEARCH stands for the folder of a whole search."""


@dataclass(frozen=True, kw_only=True)
class WholeRun:
    """A run that nobody killed: its ``command``, what it does to files (events), its seconds, and its result."""

    name: str
    command: tuple[str, ...]
    events: int
    seconds: float
    result: str


@dataclass(frozen=True, kw_only=True)
class Kill:
    """A kill: of which run, when, what came of it, the age of the journal by then [s], and the ``cause`` if refused."""

    name: str
    kind: Kind
    moment: float
    outcome: Outcome
    unsaved: float
    cause: str = ""


def whole_run(name: str, folder: Path, search: Path) -> WholeRun:
    """Do a run without a kill."""
    command = tuple(str(search) if word == "SEARCH" else word for word in COMMANDS[name])
    process = run_killed(command, folder, "time", np.inf)
    if process.returncode != 0:
        raise RuntimeError(f"{name}: {process.stderr}")
    done = json.loads(process.stderr.splitlines()[-1])
    return WholeRun(name=name, command=command, result=result_of(folder), **done)


def kill(run: WholeRun, kind: Kind, moment: float, folder: Path, *, again: float | None = None) -> Kill:
    """Kill a run at a moment, and a second time ``again`` seconds after it goes on; let it come to its end."""
    shutil.rmtree(folder, ignore_errors=True)
    process = run_killed(run.command, folder, kind, moment)
    unsaved = _age(folder / CHECKPOINT / JOURNAL)
    if process.returncode != -signal.SIGKILL:  # it was at its end
        unsaved = np.nan
    for limit in (again, None):
        if not can_resume(folder):
            break
        command = ("resume", str(folder))
        resumed = run_killed(command, folder, "time", np.inf if limit is None else limit, out=False)
        if resumed.returncode not in (0, -signal.SIGKILL):
            cause = resumed.stderr.strip().splitlines()[-2:][0]
            return Kill(name=run.name, kind=kind, moment=moment, outcome="refused", unsaved=unsaved, cause=cause)
        process = resumed
    outcome: Outcome = "nothing yet"
    if (folder / RUN).exists() and "files" in json.loads((folder / RUN).read_text()):
        outcome = "went on" if "resume" in process.args else "whole"
        outcome = outcome if result_of(folder) == run.result else "another result"
    return Kill(name=run.name, kind=kind, moment=moment, outcome=outcome, unsaved=unsaved)


def result_of(folder: Path) -> str:
    """Return the digest of a run's result: its table and its motions, bit for bit."""
    digest = sha256()
    with without_writers(folder):
        table = OPTIMA if (folder / OPTIMA).exists() else TABLE
        for name, column in pq.read_table(folder / table).to_pydict().items():
            digest.update(f"{name}{column}".encode())
        with np.load(folder / MOTIONS, allow_pickle=False) as arrays:
            for name in sorted(arrays.files):
                digest.update(name.encode() + arrays[name].tobytes())
    return digest.hexdigest()


def run_killed(
    command: tuple[str, ...], folder: Path, kind: Kind, moment: float, *, out: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run a command of ``paretoik`` into a folder, or on one without ``out``, in a process that kills itself."""
    killed = [sys.executable, "-m", "studies.benchmarks.reliability.killed_run", str(folder), kind, str(moment)]
    arguments = [*command, "--quiet", *(("--out", str(folder)) if out else ())]
    return subprocess.run([*killed, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def _age(journal: Path) -> float:
    return time.time() - journal.stat().st_mtime if journal.exists() else np.nan
