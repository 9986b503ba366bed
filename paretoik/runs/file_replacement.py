"""Replaces files: one at once or not at all, or several of a folder that belong together.

Several are written whole into `.saved`, a folder within theirs, and then move into place. They are saved from the
moment that this folder has its name: if the process is killed while they move, the next process that reads or writes
there moves the rest. Before that moment the former files are unchanged.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from paretoik.errors import InvalidInput

SAVED = ".saved"  # a folder of complete files that move into the folder around it


def replace_file(file: Path, content: bytes, *, check: Callable[[Path], object] | None = None) -> None:
    """Write ``content`` to ``file`` through a temporary file, so that no reader sees a part; make folders.

    Raises InvalidInput if the system refuses, as on a full disk, and what ``check`` raises, which gets the temporary
    file; the former file is then unchanged.
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


@dataclass(frozen=True)
class OpenFolder:
    """An open folder: work by its ``descriptor`` happens there, even if something else takes the place of ``path``."""

    path: Path
    descriptor: int


def replace_files(folder: OpenFolder, contents: Mapping[str, bytes]) -> None:
    """Replace files of a folder, by name, all or none; the folder comes from ``only_writer``.

    Raises InvalidInput if the system refuses, as on a full disk; the former files are then unchanged.
    """
    place, part = folder.descriptor, f"{SAVED}.{os.getpid()}"
    for name in contents:
        if (folder.path / name).is_dir():
            raise InvalidInput(f"{folder.path / name} must be a file to write, got a folder")
    with refusal(f"{folder.path} must be writable"):
        try:
            remove(part, place)
            os.mkdir(part, dir_fd=place)
            with plain_folder(part, within=place) as within:
                for name, content in contents.items():
                    _write(Path(name), content, within)
                os.fsync(within)
            os.rename(part, SAVED, src_dir_fd=place, dst_dir_fd=place)
        finally:
            remove(part, place)
        os.fsync(place)
        _move_saved(place)
    if os.path.lexists(folder.path / SAVED):  # somebody put it in the place of ours
        raise InvalidInput(f"{folder.path} must be writable, got something else in the place of {SAVED}")


@contextmanager
def plain_folder(folder: Path | str, *, within: int | None = None) -> Iterator[int]:
    """Yield the descriptor of a folder, in the folder of descriptor ``within``; raises OSError for a link.

    Work by descriptors stays in this folder, even if a link takes its place meanwhile.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=within)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def is_plain_folder(name: str, place: int) -> bool:
    """Return whether a name in the folder of a descriptor is a folder and no link."""
    try:
        return stat.S_ISDIR(os.stat(name, dir_fd=place, follow_symlinks=False).st_mode)
    except FileNotFoundError:
        return False


def move_files(names: Iterable[str], source: int, target: int) -> None:
    """Move entries of these names, if they exist, from one folder to another, both by descriptor; links as links."""
    for name in names:
        with suppress(FileNotFoundError):
            os.rename(name, name, src_dir_fd=source, dst_dir_fd=target)


def remove(name: str, place: int) -> None:
    """Remove a file, a link, or a folder with its content from the folder of a descriptor, if it is there."""
    try:
        os.unlink(name, dir_fd=place)
    except FileNotFoundError:
        return
    except (IsADirectoryError, PermissionError):  # a folder: the systems raise different errors
        shutil.rmtree(name, dir_fd=place)


@contextmanager
def only_writer(folder: Path, *inner: str) -> Iterator[OpenFolder]:
    """Hold a folder's lock while its files are replaced, so that of two processes neither loses what it adds.

    The folder is made if need be, and so are those within it, each ``inner`` one in the one before; these are no links.
    Files that a killed process had saved there move into place first; the lock ends with the process. Raises
    InvalidInput if the system refuses.
    """
    path = folder.joinpath(*inner)
    with ExitStack() as stack:
        with refusal(f"{path} must be a folder to write into"):
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            stack.callback(os.close, descriptor)
            for name in inner:
                with suppress(FileExistsError):
                    os.mkdir(name, dir_fd=descriptor)
                descriptor = stack.enter_context(plain_folder(name, within=descriptor))
        with refusal(f"{path} must allow a lock against a second writer"):  # some file systems have no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        stack.callback(fcntl.flock, descriptor, fcntl.LOCK_UN)  # a process forked meanwhile has the descriptor too
        with refusal(f"{path} must be writable"):
            _move_saved(descriptor)
        yield OpenFolder(path, descriptor)


@contextmanager
def without_writers(folder: Path) -> Iterator[None]:
    """Keep other processes from replacing a folder's files while the body reads them; move saved files in place first.

    A folder that is missing, or on a file system without locks, is read as it is. Raises InvalidInput if the system
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


def _move_saved(place: int) -> None:
    if is_plain_folder(SAVED, place):
        with plain_folder(SAVED, within=place) as saved:
            with os.scandir(saved) as listing:
                names = [each.name for each in listing]
            move_files(names, saved, place)
        os.rmdir(SAVED, dir_fd=place)


def _write(file: Path, content: bytes, folder: int | None = None) -> None:
    """Write a file in the folder of a descriptor; remove what a killed process left there and follow no link."""
    with suppress(FileNotFoundError):
        os.unlink(file, dir_fd=folder)
    with open(file, "xb", opener=partial(os.open, mode=0o666, dir_fd=folder)) as sink:
        sink.write(content)
        sink.flush()
        os.fsync(sink.fileno())


@contextmanager
def refusal(wish: str) -> Iterator[None]:
    """Raise InvalidInput that begins with ``wish`` if the system refuses what the body does."""
    try:
        yield
    except OSError as fault:
        raise InvalidInput(f"{wish}, got {fault.strerror}") from fault
