"""Replaces files completely or not at all, one or several together.

One file is written under another name, synchronised and renamed. Several files are written into a temporary folder,
which is renamed to `.saved`; then they move into place. If the process is killed while they move, the next process that
reads or writes there moves the rest. If it is killed before the renaming, the former files are unchanged.
"""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from paretoik.errors import InvalidInput

SAVED = ".saved"  # a folder of complete files that move into the folder around it


def replace_file(file: Path, content: bytes, *, check: Callable[[Path], object] | None = None) -> None:
    """Write ``content`` to ``file`` through a temporary file; make folders.

    No reader sees an incomplete file. ``check`` gets the temporary file before it replaces the former one. Raises
    InvalidInput if the system refuses, as on a full disk, and what ``check`` raises; the former file is then unchanged.
    """
    if file.name in ("", ".."):
        raise InvalidInput(f"{file} must be a file to write, got a folder")
    part = file.with_name(f".{file.name}.{os.getpid()}")
    with refusal(f"{file} must be writable"):
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write(part, content)
            if check is not None:
                check(part)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)


def replace_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Replace files of a folder, by name, all or none; the caller must be the folder's ``only_writer``.

    Raises InvalidInput if the system refuses, as on a full disk; the former files are then unchanged.
    """
    part = folder / f"{SAVED}.{os.getpid()}"
    for name in contents:
        if (folder / name).is_dir():
            raise InvalidInput(f"{folder / name} must be a file to write, got a folder")
    with refusal(f"{folder} must be writable"):
        try:
            remove(part)
            part.mkdir()
            for name, content in contents.items():
                _write(part / name, content)
            _synchronise(part)
            part.rename(folder / SAVED)
        finally:
            remove(part)
        _synchronise(folder)
        _move_saved(folder)


def move_files(names: Iterable[str], source: Path, target: Path) -> None:
    """Move existing entries with these names from ``source`` to ``target``."""
    for name in names:
        with suppress(FileNotFoundError):
            (source / name).rename(target / name)


def remove(place: Path) -> None:
    """Remove a file, link, or folder with content, if it exists."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Lock a folder while the body replaces its files; make it if necessary.

    Files that a killed process saved there move into place first. The lock ends with the process. Raises InvalidInput
    if the system refuses.
    """
    with refusal(f"{folder} must be a folder to write into"):
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with refusal(f"{folder} must allow a lock against a second writer"):  # some file systems have no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        with refusal(f"{folder} must be writable"):
            _move_saved(folder)
        yield
    finally:
        fcntl.flock(descriptor, fcntl.LOCK_UN)  # unlocked, as a process forked meanwhile has the descriptor too
        os.close(descriptor)


@contextmanager
def without_writers(folder: Path) -> Iterator[None]:
    """Prevent changes of a folder's files while the body reads them.

    Saved files of a killed process move into place first. A folder that is missing, or on a file system without locks,
    is read as it is. Raises InvalidInput if the system refuses to move these files.
    """
    if (folder / SAVED).is_dir():
        with only_writer(folder):
            pass
    descriptor = None
    try:
        with suppress(OSError):
            descriptor = os.open(folder, os.O_RDONLY)
            fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        if descriptor is not None:
            with suppress(OSError):
                fcntl.flock(descriptor, fcntl.LOCK_UN)  # unlocked, as a process forked meanwhile has the descriptor too
            os.close(descriptor)


@contextmanager
def refusal(wish: str) -> Iterator[None]:
    """Raise InvalidInput that begins with ``wish`` if the body raises OSError."""
    try:
        yield
    except OSError as fault:
        raise InvalidInput(f"{wish}, got {fault.strerror}") from fault


def _move_saved(folder: Path) -> None:
    saved = folder / SAVED
    if saved.is_dir():
        move_files([each.name for each in saved.iterdir()], saved, folder)
        saved.rmdir()


def _write(file: Path, content: bytes) -> None:
    with file.open("wb") as sink:
        sink.write(content)
        sink.flush()
        os.fsync(sink.fileno())


def _synchronise(folder: Path) -> None:
    """Write the names in a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
