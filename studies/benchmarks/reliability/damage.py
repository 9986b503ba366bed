"""Damage to runs: journals cut and with flipped bits, and disks that are too small.

The journal is a real one: it is cut at every byte of its end, and a bit is flipped in every field of every frame. Disks
are file systems in memory, mounted by a user in a namespace.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.runs.files import CHECKPOINT, JOURNAL
from paretoik.runs.folder import SPACE
from paretoik.runs.journal import HEAD, MARK, Journal
from studies.benchmarks.checkouts import ROOT
from studies.benchmarks.reliability.kills import COMMANDS, result_of, run_killed
from studies.reporting import Row, tell

STOPPED = ("--generations=10000", "--time-limit=2")  # of the search whose journal is damaged
FIELDS = len(MARK), 32, 8, 32  # bytes of a frame's mark, key, length and digest
CUTS = 2000  # bytes at the end of a journal
SMALLEST, FILLED, LARGE = 4096, 3 * 2**20, 2**30  # bytes: of disks; beyond a run's reserve, which it fills; enough
DELAY = 10.0  # s
SCRIPT = """mount -t tmpfs -o size="$1" tmpfs "$2" || exit 99
shift; disk="$1"; shift; copy="$1"; shift; "$@"; rc=$?; cp -r "$disk" "$copy"; exit $rc"""
"""Mount a disk of a size in a folder, run a command, and copy the content of the disk then."""


def journal_rows(folder: Path) -> Iterator[Row]:
    """Yield how many cuts lose a whole frame, and how many flipped bits lose more than their own frame."""
    tell("a journal, cut and damaged")
    run_killed((*COMMANDS["search"], *STOPPED), folder / "journal", "else", np.inf)
    content, part = (folder / "journal" / CHECKPOINT / JOURNAL).read_bytes(), folder / "part"
    keys, ends = _keys(content, part), [0]
    while ends[-1] < len(content):
        ends.append(ends[-1] + HEAD.size + HEAD.unpack_from(content, ends[-1])[2])
    wrong = sum(
        set(_keys(content[:length], part)) != set(keys[: sum(length >= end for end in ends) - 1])
        for length in range(max(len(content) - CUTS, 0), len(content))
    )
    note = f"of {min(CUTS, len(content))} bytes at its end, {len(content)} in all"
    yield Row("journal", "cuts", "wrong", "", wrong, reference=0, source="goal", note=note)
    rng, counts = np.random.default_rng(0), {"its own frame": 0, "refused": 0, "wrong": 0}
    for frame, (begin, end) in enumerate(pairwise(ends)):
        for first, last in pairwise([*accumulate(FIELDS, initial=begin), end]):  # ... and the payload
            damaged = bytearray(content)
            damaged[rng.integers(first, last)] ^= 1 << int(rng.integers(8))
            try:
                intact = set(_keys(bytes(damaged), part))
                counts["its own frame" if intact == set(keys) - {keys[frame]} else "wrong"] += 1
            except InvalidRun:
                counts["refused"] += 1
    note = ", ".join(f"{number} {outcome}" for outcome, number in counts.items())
    wrong = counts["wrong"] + counts["refused"]
    yield Row("journal", "flipped bits", "wrong", "", wrong, reference=0, source="goal", note=note)


def _keys(content: bytes, part: Path) -> list[bytes]:
    """Return the keys of the intact frames of a journal, in order."""
    part.write_bytes(content)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*are damaged")
        journal = Journal(part)
    keys = list(journal.keys)
    journal.close()
    return keys


def namespaces_can_mount() -> bool:
    """Return whether this system lets a user mount file systems in a namespace."""
    if shutil.which("unshare") is None:
        return False
    command = ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def disk_rows(folder: Path, count: int) -> Iterator[Row]:
    """Yield the outcomes of a search on disks that are too small, and its delay against a large one."""
    if not namespaces_can_mount():
        print("left out: small disks, as this system lets no user mount any")
        return
    _, whole, _ = _run_on_disk(LARGE, folder, "")
    result, outcomes, delay, lost = result_of(folder / "copy" / "run"), Counter[str](), -np.inf, ""
    # Half of them have room for a result, and fill up during the run.
    small = np.geomspace(SMALLEST, SPACE, count // 2, endpoint=False)
    for size in [*small.astype(int), *np.linspace(SPACE, SPACE + FILLED, count - count // 2).astype(int)]:
        outcome, seconds, words = _run_on_disk(int(size), folder, result)
        tell(f"a disk of {size / 2**20:.3g} MB: {outcome}")
        outcomes[outcome] += 1
        delay, lost = max(delay, seconds - whole), lost or (words if outcome == "lost" else "")
    row = partial(Row, "full disks", "search")
    yield row("disks", "", count, note=", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common()))
    yield row("lost", "", outcomes["lost"], reference=0, source="goal", note=lost)
    yield row("longer than on a large one, most", "s", delay, reference=DELAY, source="goal")


def _run_on_disk(size: int, folder: Path, result: str) -> tuple[str, float, str]:
    """Return outcome, seconds and last words of a search on a disk [bytes]; ``result`` is that of a large disk."""
    disk, copy = folder / "disk", folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    disk.mkdir(exist_ok=True)
    run = [sys.executable, "-m", "paretoik", *COMMANDS["search"], "--quiet", "--out", str(disk / "run")]
    namespace = ["unshare", "--map-root-user", "--mount", "sh", "-c", SCRIPT, "sh", str(size), str(disk), str(copy)]
    begin = time.monotonic()
    process = subprocess.run([*namespace, *run], cwd=ROOT, capture_output=True, text=True, check=False)
    seconds, words, run_folder = time.monotonic() - begin, process.stderr.strip().rpartition("\n")[2], copy / "run"
    if process.returncode == 2 and process.stderr.startswith("error: ") and not (run_folder / "checkpoint").exists():
        return "refused at once", seconds, words
    saved = (run_folder / "run.json").exists() and "files" in json.loads((run_folder / "run.json").read_text())
    kept = process.returncode == 0 and saved and result_of(run_folder) == result
    return "result kept" if kept else "lost", seconds, words
