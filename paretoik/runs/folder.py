"""The folder that a run writes into: who may write there, and which of its files a new run replaces."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from paretoik.errors import InvalidInput, warn_user
from paretoik.runs.file_replacement import SAVED, move_files, only_writer, refusal, remove
from paretoik.runs.files import CONTENTS, FORMER, RUN, can_resume, has_result, is_run, was_cut_off

# The run that a new one replaces: set aside, and put back unless the new one has a result.
#
# Its files move into `.former-run`, a folder within the run's own. While they move, in or out, it is called
# `.former-run.part`, and its files belong back. So if the process is killed at any moment, the next one knows which of
# the two runs is whole. The caller of these functions holds the folder's lock.


PART = f"{FORMER}.part"


def set_aside(folder: Path) -> None:
    """Move the run in a folder into `.former-run` within it; remove one without a result that cannot resume."""
    if has_result(folder) or can_resume(folder):
        part = folder / PART
        part.mkdir()
        move_files(reversed(CONTENTS), folder, part)  # run.json last: a folder without it is no run
        part.rename(folder / FORMER)
    remove_run(folder)  # files that a killed writer left incomplete


def settle(folder: Path) -> bool:
    """Remove the run that was set aside if the new one has a result, else put it back; return whether it is back."""
    former, part = folder / FORMER, folder / PART
    if former.is_dir():
        if has_result(folder):
            remove(former)
            return False
        remove_run(folder)
        former.rename(part)
    if not part.is_dir():
        return False
    move_files(CONTENTS, part, folder)
    part.rmdir()
    return True


def remove_run(folder: Path) -> None:
    """Remove the files of a run from its folder, and nothing else."""
    for name in (*reversed(CONTENTS), SAVED):
        for place in (folder / name, *folder.glob(f".{name.lstrip('.')}.*")):
            remove(place)


# Disk space for a run's result, held by a file until the result is written: nothing else can fill it.


SPACE = 8 * 2**20  # bytes that are held: 200 motions of 7 joints at 501 samples take 6 MB


class ReservedSpace:
    """Disk space that a ``file`` holds, from the start.

    Raises InvalidInput if the disk has less. If a limit on the size of files does not allow such a file, nothing is
    held.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        try:
            self.take()
        except OSError as fault:
            self.release()
            if fault.errno in (errno.ENOSPC, errno.EDQUOT):
                with suppress(OSError):  # the folder of a resumed run has more in it
                    file.parent.rmdir()
                run = file.parent.parent
                wish = f"must have {SPACE / 2**20:g} MB of free disk for the result"
                raise InvalidInput(f"{run} {wish}, got {shutil.disk_usage(run).free / 2**20:.2g} MB") from None

    def take(self) -> None:
        """Hold the disk space; raises OSError if there is too little."""
        self._file.parent.mkdir(exist_ok=True)
        self._file.write_bytes(bytes(SPACE))

    def release(self) -> None:
        """Free the disk space for the result."""
        with suppress(OSError):
            self._file.unlink()


# The folder of a run: its lock and its files.


LOCK = ".lock"


@contextmanager
def claim_folder(folder: Path | str, *, overwrite: bool = False) -> Iterator[Path]:
    """Make `folder` if need be and lock it against every other writer while the body runs.

    Once the body ends with the result of a new run there, the files of the former run are removed, and nothing else;
    without a result they are as they were. If the process is killed, the next one that locks the folder puts them back.
    Raises InvalidInput if the folder cannot be made, has something that is no run, has a run with a result or one to
    resume without `overwrite`, or if another process is writing into it.
    """
    place = Path(folder)
    with _refusal(place):
        if not (place / LOCK).exists():  # nobody writes there: it is refused before anything is written
            _check_replaceable(place, overwrite=overwrite)
        place.mkdir(parents=True, exist_ok=True)
    with lock_folder(place):
        _check_replaceable(place, overwrite=overwrite)
        try:
            with _refusal(place), only_writer(place):
                set_aside(place)
            yield place
        finally:
            with _refusal(place), only_writer(place):
                settle(place)


def _check_replaceable(place: Path, *, overwrite: bool) -> None:
    """Raise InvalidInput for a run with a result, or one that can be resumed, without permission to overwrite it."""
    if not overwrite and (has_result(place) or was_cut_off(place)):
        raise InvalidInput(f"{place} must be a new folder, got one that holds a run; use --overwrite to replace it")


@contextmanager
def lock_folder(place: Path) -> Iterator[Path]:
    """Lock a folder that is empty or holds a run against every other writer while the body runs.

    Warns if it puts back a run that a killed process was to replace. Raises InvalidInput if the folder cannot be
    locked, or another process is writing into it.
    """
    with _locked(place):
        with _refusal(place), only_writer(place):
            restored = settle(place)
        if restored:
            warn_user(f"{place}: the process that was to replace its run ended without a result; that run is back")
        yield place


@contextmanager
def reclaim_folder(place: Path) -> Iterator[Path]:
    """Lock the folder of a resumed run, with all files there, against every other writer while the body runs.

    A run that it is to replace is removed once the body ends with a result, and is kept otherwise. Raises InvalidInput
    if the folder cannot be locked, or another process is writing into it.
    """
    with _locked(place):
        try:
            yield place
        finally:
            with _refusal(place), only_writer(place):
                if has_result(place):
                    settle(place)


@contextmanager
def _locked(place: Path) -> Iterator[None]:
    """Lock the folder of a run, or an empty one; raises InvalidInput for others."""
    with _refusal(place):
        names = sorted(entry.name for entry in place.iterdir())
    others = [name for name in names if not name.startswith((LOCK, f".{RUN}.", FORMER, SAVED))]
    if others and not any(is_run(folder / RUN) for folder in (place, place / FORMER, place / PART)):
        raise InvalidInput(f"{place} must be a new folder, an empty one or a run, got one that holds {others[0]}")
    with _lock(place):
        yield


@contextmanager
def _lock(place: Path) -> Iterator[None]:
    """Hold the lock of a run's folder, which ends with the process; the file that is locked names the process."""
    with _refusal(place):
        file = (place / LOCK).open("a+b")
    with file as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as fault:
            lock.seek(0)
            writer = lock.read(20).decode(errors="replace").strip() or "unknown"
            raise InvalidInput(f"{place} must have no other writer, got process {writer} at work there") from fault
        except OSError as fault:  # some file systems have no locks
            raise InvalidInput(f"{place} must allow a lock against a second writer, got {fault.strerror}") from fault
        lock.truncate(0)
        lock.write(str(os.getpid()).encode())
        lock.flush()
        yield


def _refusal(place: Path) -> AbstractContextManager[None]:
    return refusal(f"{place} must be a folder to write a run into")


def check_no_run(folder: Path) -> None:
    """Raise InvalidInput if a process runs in a folder, with its lock."""
    if (folder / LOCK).exists():
        with _lock(folder):
            pass


def check_other_folder(name: str, folder: Path, *sources: Path | None) -> None:
    """Raise InvalidInput, by ``name``, if a folder is that of a run that its new content comes from."""
    if any(source is not None and source.resolve() == folder.resolve() for source in sources):
        raise InvalidInput(f"{name} must not be the folder of the source run, got {folder}")
