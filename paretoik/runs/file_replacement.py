"""How files are replaced: one at once or not at all, or several of a folder that belong together.

Several are written whole into `.saved`, a folder within theirs, and then move into place. From the moment that folder
has its name they are saved: should the process be killed while they move, whoever next reads or writes there moves
the rest. Before that moment the former files are as they were.
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


@dataclass(frozen=True)
class OpenFolder:
    """A folder that is open: what is done by its ``descriptor`` is done there, whatever takes the place of ``path``."""

    path: Path
    descriptor: int


def replace_files(folder: OpenFolder, contents: Mapping[str, bytes]) -> None:
    """Replace files of a folder, by name, all at once or none of them; the folder is that of an ``only_writer``.

    Raises InvalidInput where the system refuses, as on a full disk; the former files are unchanged then.
    """
    place, part = folder.descriptor, f"{SAVED}.{os.getpid()}"
    for name in contents:
        if (folder.path / name).is_dir():
            raise InvalidInput(f"{folder.path / name}: wanted to write it, got a folder")
    with refusal(f"{folder.path}: wanted to write it"):
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
        raise InvalidInput(f"{folder.path}: wanted to write it, got something else in the place of {SAVED}")


@contextmanager
def plain_folder(folder: Path | str, *, within: int | None = None) -> Iterator[int]:
    """Yield the descriptor of a folder, ``within`` that of a descriptor; raises OSError for a link, which is not one.

    What is done by descriptors is not led elsewhere by a link that takes the folder's place meanwhile.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=within)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def is_plain_folder(name: str, place: int) -> bool:
    """Say whether a name, in the folder of a descriptor, is that of a folder and no link."""
    try:
        return stat.S_ISDIR(os.stat(name, dir_fd=place, follow_symlinks=False).st_mode)
    except FileNotFoundError:
        return False


def move_files(names: Iterable[str], source: int, target: int) -> None:
    """Move what has these names, if it is there, from the folder of a descriptor to that of another; links as links."""
    for name in names:
        with suppress(FileNotFoundError):
            os.rename(name, name, src_dir_fd=source, dst_dir_fd=target)


def remove(name: str, place: int) -> None:
    """Remove a file, a link, or a folder with all that is in it, from the folder of a descriptor, if it is there."""
    try:
        os.unlink(name, dir_fd=place)
    except FileNotFoundError:
        return
    except (IsADirectoryError, PermissionError):  # of a folder: the systems differ
        shutil.rmtree(name, dir_fd=place)


@contextmanager
def only_writer(folder: Path, *inner: str) -> Iterator[OpenFolder]:
    """Hold a folder's lock while its files are replaced, so that of two processes neither loses what it adds.

    The folder is made if need be, and so are those within it, each ``inner`` one in the one before; these are no links.
    What a killed process had saved there moves into place first; the lock ends with the process. Raises InvalidInput
    where the system refuses.
    """
    path = folder.joinpath(*inner)
    with ExitStack() as stack:
        with refusal(f"{path}: wanted a folder to write into"):
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            stack.callback(os.close, descriptor)
            for name in inner:
                with suppress(FileExistsError):
                    os.mkdir(name, dir_fd=descriptor)
                descriptor = stack.enter_context(plain_folder(name, within=descriptor))
        with refusal(f"{path}: wanted to lock it against a second writer"):  # not on file systems without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        stack.callback(fcntl.flock, descriptor, fcntl.LOCK_UN)  # a process forked meanwhile has the descriptor too
        with refusal(f"{path}: wanted to write it"):
            _move_saved(descriptor)
        yield OpenFolder(path, descriptor)


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


def _move_saved(place: int) -> None:
    if is_plain_folder(SAVED, place):
        with plain_folder(SAVED, within=place) as saved:
            with os.scandir(saved) as listing:
                names = [each.name for each in listing]
            move_files(names, saved, place)
        os.rmdir(SAVED, dir_fd=place)


def _write(file: Path, content: bytes, folder: int | None = None) -> None:
    """Write a file, in the folder of a descriptor: what a killed process left there goes, no link is followed."""
    with suppress(FileNotFoundError):
        os.unlink(file, dir_fd=folder)
    with open(file, "xb", opener=partial(os.open, mode=0o666, dir_fd=folder)) as sink:
        sink.write(content)
        sink.flush()
        os.fsync(sink.fileno())


@contextmanager
def refusal(wish: str) -> Iterator[None]:
    """Raise InvalidInput, with what was wanted, where the system refuses what the body does."""
    try:
        yield
    except OSError as fault:
        raise InvalidInput(f"{wish}, got {fault.strerror}") from fault
