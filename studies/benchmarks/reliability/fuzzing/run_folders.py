"""A run folder with one file of any bytes: every reader opens it, or refuses it."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.front.choice_tree import read_choices
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.runs.files import CHECKPOINT, CHOICES, JOURNAL, MOTIONS, RUN, TABLE, run_bytes
from paretoik.runs.journal import Journal, key_of
from studies.benchmarks.reliability.fuzzing.defect import refusals

STORED_JOURNAL = f"{CHECKPOINT}/{JOURNAL}"
FILES = (RUN, TABLE, MOTIONS, CHOICES, STORED_JOURNAL)


class RunFolders:
    """Reads bytes as one file of a run: the first says which, and whether the others get new digests."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "run"
        self.contents = whole_run(self._folder)

    def __call__(self, data: bytes) -> None:
        """Open a run with one file replaced, by every reader; raise Defect."""
        if not data:
            return
        name, is_anew = FILES[data[0] // 2 % len(FILES)], bool(data[0] % 2)
        self._write({**self.contents, name: data[1:]}, name if is_anew else None)
        names = ("run", *FILES)
        with refusals(*names):
            front = pk.Front.load(self._folder)
            assert repr(front)
            front.select("compromise")
        with refusals(*names):
            assert repr(read_choices(self._folder))
        with refusals(*names):
            Journal(self._folder / STORED_JOURNAL).close()
        with refusals(*names):
            assert repr(pk.verify(self._folder))

    def _write(self, contents: dict[str, bytes], anew: str | None) -> None:
        if anew is not None:
            contents = with_digests(contents)
        for file, content in contents.items():
            (self._folder / file).parent.mkdir(exist_ok=True)
            (self._folder / file).write_bytes(content)


def whole_run(folder: Path) -> dict[str, bytes]:
    """Write a small run with choices and a journal, and return the contents of its files by name."""
    shutil.rmtree(folder, ignore_errors=True)
    q = np.linspace(0.0, 1.0, 3 * 5 * 2).reshape(3, 5, 2)
    motions = StoredMotions(arm=StoredJoints(joint_names=("a", "b")), time=np.tile(np.arange(5.0), (3, 1)), q=q)
    front = pk.Front(
        ids=np.array([0, 3, 7]),
        objectives=np.array([[1.0, 3.0], [2.0, 2.0], [3.0, 1.0]]),
        names=["f", "g"],
        units=["J", ""],
        maximised=[False, False],
        motions=motions,
        violation=np.zeros(3),
        provenance={"status": "generations", "seed": 1},
    )
    front.save(folder)
    front.select("compromise")
    journal = Journal(folder / STORED_JOURNAL)
    journal.append(key_of("key"), {"F": np.ones((2, 2)), "names": np.array(["x"])})
    journal.close()
    return {file: (folder / file).read_bytes() for file in FILES}


def with_digests(contents: dict[str, bytes]) -> dict[str, bytes]:
    """Return files with digests that fit; digests of invalid JSON stay as they are."""
    contents = dict(contents)
    for file in (RUN, CHOICES):
        try:
            entries = json.loads(contents[file])
            if file == RUN:
                entries["files"] = {
                    each: hashlib.sha256(contents[each]).hexdigest() if each in contents else digest
                    for each, digest in entries["files"].items()
                }
            version = entries.pop("format")
            entries.pop("digest", None)
            contents[file] = run_bytes(entries).replace(b'"format": 1', f'"format": {json.dumps(version)}'.encode(), 1)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            continue
    return contents
