"""Runs on disks that are too small: file systems in memory, mounted by a user in a namespace."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.runs.folder import SPACE
from studies.benchmarks.checkouts import ROOT
from studies.benchmarks.reliability.kills import COMMANDS, result_of

DiskOutcome = Literal["refused at once", "result kept", "lost"]
MOUNTED = 'mount -t tmpfs -o size="$1" tmpfs "$2" || exit 99; shift; disk="$1"; shift; copy="$1"; shift; "$@"; rc=$?'
SCRIPT = f'{MOUNTED}; cp -r "$disk" "$copy"; exit $rc'
"""Mount a disk of a size in a folder, run a command, and copy the content of the disk then."""


@dataclass(frozen=True, kw_only=True)
class DiskOptions:
    """Disks are up to ``bytes`` larger than the space that a run reserves for its result; it fills them."""

    bytes: int = 3 * 2**20
    smallest: int = 4096


OPTIONS = DiskOptions()


@dataclass(frozen=True, kw_only=True)
class SmallDisk:
    """A run on a disk of ``bytes``: its outcome, its seconds, and its last words."""

    bytes: int
    outcome: DiskOutcome
    seconds: float
    words: str


def disk_sizes(count: int) -> Iterator[int]:
    """Yield sizes [bytes]; half of them have room for a result and fill up during the run."""
    small = count // 2
    yield from np.geomspace(OPTIONS.smallest, SPACE, small, endpoint=False).astype(int).tolist()
    yield from np.linspace(SPACE, SPACE + OPTIONS.bytes, count - small).astype(int).tolist()


def namespaces_can_mount() -> bool:
    """Return whether this system lets a user mount file systems in a namespace."""
    if shutil.which("unshare") is None:
        return False
    command = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def run_on_small_disk(name: str, size: int, folder: Path, result: str) -> SmallDisk:
    """Run on a disk of a size [bytes]; ``result`` is that of a large disk."""
    disk, copy = folder / "disk", folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    disk.mkdir(exist_ok=True)
    run = [sys.executable, "-m", "paretoik", *COMMANDS[name], "--quiet", "--out", str(disk / "run")]
    namespace = ["unshare", "--map-root-user", "--mount", "sh", "-c", SCRIPT, "sh", str(size), str(disk), str(copy)]
    begin = time.monotonic()
    process = subprocess.run([*namespace, *run], cwd=ROOT, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - begin
    words = (process.stderr.strip().splitlines() or [""])[-1]
    return SmallDisk(bytes=size, outcome=_outcome(process, copy / "run", result), seconds=seconds, words=words)


def _outcome(process: subprocess.CompletedProcess[str], run: Path, result: str) -> DiskOutcome:
    if process.returncode == 2 and process.stderr.startswith("error: ") and not (run / "checkpoint").exists():
        return "refused at once"
    saved = (run / "run.json").exists() and "files" in json.loads((run / "run.json").read_text())
    return "result kept" if process.returncode == 0 and saved and result_of(run) == result else "lost"
