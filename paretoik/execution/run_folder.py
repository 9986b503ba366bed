"""The folder that a run writes into: who may write there, and what the run says of itself."""

from __future__ import annotations

import fcntl
import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any, BinaryIO

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.files import replace_file

FORMAT = 1
RUN = "run.json"
RECORDING = "review.rrd"
PICTURE = "front.png"
CERTIFICATES = "certificates.png"
STEPS = "steps.parquet"
CHECKPOINT = "checkpoint"
CONTENTS = (RUN, "front.parquet", "motions.npz", RECORDING, PICTURE, CERTIFICATES, STEPS, CHECKPOINT)
LOCK = ".lock"


@contextmanager
def claimed(folder: Path | str, *, overwrite: bool = False) -> Iterator[Path]:
    """Make `folder` if need be and hold it against every other writer while the body runs.

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
        foreign = _foreign_entry(place)
        if foreign is not None:
            raise InvalidInput(f"{place}: wanted a new folder, an empty one or a run, got one that holds {foreign}")
        # Opened by hand because a link in its place must not be followed: its target would be emptied.
        lock = os.fdopen(os.open(place / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "r+b")
    except OSError as fault:
        raise InvalidInput(f"{place}: wanted a folder to write a run into, got {fault.strerror}") from fault
    with lock:
        _hold(lock, place)
        if (place / RUN).exists() and not overwrite:
            raise InvalidInput(
                f"{place}: wanted a new folder or permission to overwrite (--overwrite), got one that holds a run"
            )
        _remove_run(place)
        yield place


def write_run(folder: Path, entries: Mapping[str, Any]) -> None:
    """Write `entries` as the folder's `run.json`, strict JSON, replaced at once or not at all.

    Raises
    ------
    InvalidInput
        The file cannot be written, or an entry is nothing that JSON knows.
    """
    content = json.dumps({"format": FORMAT, **plain(entries)}, indent=2, allow_nan=False)
    replace_file(folder / RUN, content.encode() + b"\n")


def plain(value: Any, *, name: str = "run") -> Any:
    """Return `value` as strict JSON knows it: arrays as lists, paths as text, numbers that are not finite as null.

    Raises
    ------
    InvalidInput
        Something in it is neither number, text, truth value, nothing, list nor mapping.
    """
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return float(value) if math.isfinite(value) else None
        case np.generic() | np.ndarray():
            return plain(value.tolist(), name=name)
        case PurePath():
            return str(value)
        case Mapping():
            return {str(key): plain(item, name=f"{name}.{key}") for key, item in value.items()}
        case list() | tuple():
            return [plain(item, name=f"{name}[{index}]") for index, item in enumerate(value)]
        case _:
            raise InvalidInput(f"{name}: wanted what JSON can hold, got {type(value).__name__}")


def _foreign_entry(place: Path) -> str | None:
    """Return the name of something that makes `place` a folder that is not ours, None where it is empty or a run."""
    names = sorted(entry.name for entry in place.iterdir())
    others = [name for name in names if not name.startswith((LOCK, f".{RUN}."))]
    return None if not others or _is_run(place / RUN) else others[0]


def _is_run(file: Path) -> bool:
    try:
        run = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(run, dict) and "format" in run


def _hold(lock: BinaryIO, place: Path) -> None:
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
