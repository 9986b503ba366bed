"""How files are replaced: one at once or not at all, or several of a folder that belong together.

Several are written whole into `.saved`, a folder within theirs, and then move into place. From the moment that folder
has its name they are saved: should the process be killed while they move, whoever next reads or writes there moves
the rest. Before that moment the former files are as they were.
"""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from paretoik.errors import InvalidInput

SAVED = ".saved"  # a folder of files that are whole and on their way into the folder that it is in


def replace_file(file: Path, content: bytes, *, check: Callable[[Path], object] | None = None) -> None:
    """Write ``content`` into a temporary file and rename it to ``file``, so that no reader sees a part; make folders.

    Raises InvalidInput where the system refuses, as on a full disk, and what ``check`` raises, which sees the temporary
    file; the former file is unchanged then.
    """
    if file.name in ("", ".."):
        raise InvalidInput(f"{file}: wanted to write it, got a folder")
    part = file.with_name(f".{file.name}.{os.getpid()}")
    with refusal(f"{file}: wanted to write it"):
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            _write(part, content)
            if check is not None:
                check(part)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)


def replace_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Replace files of a folder, by name, all at once or none of them. Whoever calls this is the ``only_writer``.

    Raises InvalidInput where the system refuses, as on a full disk; the former files are unchanged then.
    """
    for name in contents:
        if (folder / name).is_dir():
            raise InvalidInput(f"{folder / name}: wanted to write it, got a folder")
    part = folder / f"{SAVED}.{os.getpid()}"
    with refusal(f"{folder}: wanted to write it"):
        try:
            _remove(part)
            part.mkdir()
            with plain_folder(part) as place:
                for name, content in contents.items():
                    _write(Path(name), content, place)
                os.fsync(place)
            part.rename(folder / SAVED)
        finally:
            _remove(part)
        _synchronise(folder)
        _move_saved(folder)
    if os.path.lexists(folder / SAVED):  # somebody put it in the place of ours
        raise InvalidInput(f"{folder}: wanted to write it, got something else in the place of {SAVED}")


@contextmanager
def plain_folder(folder: Path) -> Iterator[int]:
    """Yield the descriptor of a folder, for what is done in it; raises OSError for a link, which may lead anywhere."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold a folder's lock while its files are replaced, so that of two processes neither loses what it adds.

    The folder is made if need be, and what a killed process had saved there moves into place first; the lock ends with
    the process. Raises InvalidInput where the system refuses.
    """
    with refusal(f"{folder}: wanted a folder to write into"):
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        with refusal(f"{folder}: wanted to lock it against a second writer"):  # not on file systems without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        try:
            with refusal(f"{folder}: wanted to write it"):
                _move_saved(folder)
            yield
        finally:
            fcntl.flock(descriptor, fcntl.LOCK_UN)  # a process forked meanwhile has the descriptor too
    finally:
        os.close(descriptor)


@contextmanager
def without_writers(folder: Path) -> Iterator[None]:
    """Let no process replace a folder's files while the body reads them, and have what was saved there in place.

    A folder that is missing, or on a file system without locks, is read as it is. Raises InvalidInput where the system
    refuses to move files that a killed process had saved.
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
                fcntl.flock(descriptor, fcntl.LOCK_UN)  # a process forked meanwhile has the descriptor too
            os.close(descriptor)


def _move_saved(folder: Path) -> None:
    saved = folder / SAVED
    if saved.is_symlink() or not saved.is_dir():
        return
    for file in saved.iterdir():
        file.replace(folder / file.name)
    saved.rmdir()


def _remove(part: Path) -> None:
    """Remove a folder of files that are not saved, whatever a killed process left of it; a link is not followed."""
    if part.is_symlink() or part.is_file():
        part.unlink()
    shutil.rmtree(part, ignore_errors=True)


def _write(file: Path, content: bytes, folder: int | None = None) -> None:
    """Write a file, in the folder of a descriptor: what a killed process left there goes, no link is followed."""
    with suppress(FileNotFoundError):
        os.unlink(file, dir_fd=folder)
    with open(file, "xb", opener=partial(os.open, mode=0o666, dir_fd=folder)) as sink:
        sink.write(content)
        sink.flush()
        os.fsync(sink.fileno())


def _synchronise(folder: Path) -> None:
    """Have the names in a folder on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def refusal(wish: str) -> Iterator[None]:
    """Raise InvalidInput, with what was wanted, where the system refuses what the body does."""
    try:
        yield
    except OSError as fault:
        raise InvalidInput(f"{wish}, got {fault.strerror}") from fault
