"""The folder that a run writes into: who may write there, and which of its files a new run replaces."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from paretoik.errors import InvalidInput
from paretoik.run_files import CONTENTS, RUN, is_run

LOCK = ".lock"


@contextmanager
def claim_folder(folder: Path | str, *, overwrite: bool = False) -> Iterator[Path]:
    """Make `folder` if need be and lock it against every other writer while the body runs.

    A folder that holds a run is accepted with `overwrite` only, which removes that run's files and nothing else. The
    lock is the kernel's: it ends with the process (and those forked from it), however that ends.

    Raises
    ------
    InvalidInput
        The folder cannot be made, holds something that is no run, holds a run while `overwrite` is false, or another
        process is writing into it.
    """
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InvalidInput(f"{place}: wanted a folder to write a run into, got {fault.strerror}") from fault
    with lock_folder(place):
        if (place / RUN).exists() and not overwrite:
            raise InvalidInput(
                f"{place}: wanted a new folder or permission to overwrite (--overwrite), got one that holds a run"
            )
        _remove_run(place)
        yield place


@contextmanager
def lock_folder(place: Path) -> Iterator[Path]:
    """Lock a folder that is empty or holds a run against every other writer while the body runs.

    Raises InvalidInput where that cannot be, or another process is writing into it.
    """
    try:
        foreign = _foreign_entry(place)
        if foreign is not None:
            raise InvalidInput(f"{place}: wanted a new folder, an empty one or a run, got one that holds {foreign}")
        # Opened by hand because a link in its place must not be followed: its target would be emptied.
        lock = os.fdopen(os.open(place / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "r+b")
    except OSError as fault:
        raise InvalidInput(f"{place}: wanted a folder to write a run into, got {fault.strerror}") from fault
    with lock:
        _lock(lock, place)
        yield place


def _foreign_entry(place: Path) -> str | None:
    """Return the name of an entry that makes `place` a folder that is not ours, None where it is empty or a run."""
    names = sorted(entry.name for entry in place.iterdir())
    others = [name for name in names if not name.startswith((LOCK, f".{RUN}."))]
    return None if not others or is_run(place / RUN) else others[0]


def _lock(lock: BinaryIO, place: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as fault:
        lock.seek(0)
        writer = lock.read(20).decode(errors="replace").strip() or "unknown"
        raise InvalidInput(f"{place}: wanted to be its only writer, got process {writer} at work there") from fault
    except OSError as fault:
        raise InvalidInput(f"{place}: wanted to lock it against a second writer, got {fault.strerror}") from fault
    lock.truncate(0)
    lock.write(str(os.getpid()).encode())
    lock.flush()


def _remove_run(place: Path) -> None:
    for name in CONTENTS:
        for entry in (place / name, *place.glob(f".{name}.*")):
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            else:
                entry.unlink(missing_ok=True)
