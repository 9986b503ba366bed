"""The folder of a run: its lock, and replacement of former runs."""

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

# The run that a new one replaces: it is set aside, and restored if the new one has no result.
#
# Its files move into `.former-run`, a folder within the run's own. While they move, in or out, it is called
# `.former-run.part`, and its files belong to the run's own folder. So if the process is killed at any moment, the next
# one knows which of the two runs is whole. The caller of these functions holds the folder's lock.


PART = f"{FORMER}.part"


def set_aside(folder: Path) -> None:
    """Move a folder's run into `.former-run`, or remove it if it has no result and cannot resume."""
    if has_result(folder) or can_resume(folder):
        part = folder / PART
        part.mkdir()
        move_files(reversed(CONTENTS), folder, part)  # run.json moves last: a folder without it is no run
        part.rename(folder / FORMER)
    remove_run(folder)  # removes incomplete files of a killed writer


def settle(folder: Path) -> bool:
    """Remove the run set aside if the new one has a result, else restore it; return whether it was restored."""
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
    """Remove the files of a run from its folder, nothing else."""
    for name in (*reversed(CONTENTS), SAVED):
        for place in (folder / name, *folder.glob(f".{name.lstrip('.')}.*")):
            remove(place)


# Disk space for a run's result: a file of this size occupies it until the result is written.


SPACE = 8 * 2**20  # bytes reserved: 200 motions of 7 joints at 501 samples take 6 MB


class ReservedSpace:
    """Disk space that a ``file`` occupies from the start of a run.

    Raises InvalidInput if the disk has less space. If the system's limit on file sizes does not allow the file, no
    space is reserved.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        try:
            self.take()
        except OSError as fault:
            self.release()
            if fault.errno in (errno.ENOSPC, errno.EDQUOT):
                with suppress(OSError):  # not empty if the run is resumed
                    file.parent.rmdir()
                run = file.parent.parent
                wish = f"must have {SPACE / 2**20:g} MB of free disk for the result"
                raise InvalidInput(f"{run} {wish}, got {shutil.disk_usage(run).free / 2**20:.2g} MB") from None

    def take(self) -> None:
        """Occupy the disk space; raise OSError if there is too little."""
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
    """Make and lock a run's `folder` while the body runs.

    If the body ends with a result of the new run, the files of the former run are removed, and nothing else. Without a
    result they are restored. If the process is killed, the next one that locks the folder restores them. Raises
    InvalidInput if the folder cannot be made, contains something other than a run, or is written by another process;
    and, unless ``overwrite``, if it contains a run that has a result or can resume.
    """
    place = Path(folder)
    with _refusal(place):
        if not (place / LOCK).exists():  # no lock, so no writer: refuse the folder before anything is written
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
    """Raise InvalidInput if a run has a result or can resume, unless ``overwrite``."""
    if not overwrite and (has_result(place) or was_cut_off(place)):
        raise InvalidInput(f"{place} must be a new folder, got one that holds a run; use --overwrite to replace it")


@contextmanager
def lock_folder(place: Path) -> Iterator[Path]:
    """Lock a folder, empty or with a run, while the body runs; warn if a killed process's run is restored.

    Raises InvalidInput if the folder cannot be locked, or another process is writing into it.
    """
    with _locked(place):
        with _refusal(place), only_writer(place):
            restored = settle(place)
        if restored:
            warn_user(f"{place}: the process that was to replace its run ended without a result; the run was restored")
        yield place


@contextmanager
def reclaim_folder(place: Path) -> Iterator[Path]:
    """Lock the folder of a resumed run, with all its files; if it has a result, remove the run that it replaces.

    Raises InvalidInput if the folder cannot be locked, or another process is writing into it.
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
    """Lock the folder of a run, or an empty folder, in the body; raises InvalidInput for other folders."""
    with _refusal(place):
        names = sorted(entry.name for entry in place.iterdir())
    others = [name for name in names if not name.startswith((LOCK, f".{RUN}.", FORMER, SAVED))]
    if others and not any(is_run(folder / RUN) for folder in (place, place / FORMER, place / PART)):
        raise InvalidInput(f"{place} must be a new folder, an empty one or a run, got one that holds {others[0]}")
    with _lock(place):
        yield


@contextmanager
def _lock(place: Path) -> Iterator[None]:
    """Lock a run's folder; the lock file names the process. The lock ends with the process."""
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
    """Raise InvalidInput if a process is running in a folder."""
    if (folder / LOCK).exists():
        with _lock(folder):
            pass


def check_other_folder(name: str, folder: Path, *sources: Path | None) -> None:
    """Raise InvalidInput, with ``name``, if a folder to write is also one of the ``sources``."""
    if any(source is not None and source.resolve() == folder.resolve() for source in sources):
        raise InvalidInput(f"{name} must not be the folder of the source run, got {folder}")
