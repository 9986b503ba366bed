"""Room on the disk for a run's result, held by a file until the result is written: nothing else can fill it."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from paretoik.errors import InvalidInput
from paretoik.file_replacement import plain_folder


@dataclass(frozen=True, kw_only=True)
class SpaceOptions:
    """How many ``bytes`` are held: 200 motions of 7 joints at 501 samples take 6 MB."""

    bytes: int = 8 * 2**20


OPTIONS = SpaceOptions()


class ReservedSpace:
    """Room that a ``file`` holds, which is taken at once.

    Raises InvalidInput where the disk has less. Where a file system or a limit on the size of files does not allow such
    a file, nothing is held.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        try:
            self.take()
        except OSError as fault:
            self.release()
            if fault.errno in (errno.ENOSPC, errno.EDQUOT):
                with suppress(OSError):  # that of a run that goes on has more in it
                    file.parent.rmdir()
                wish = f"{OPTIONS.bytes / 2**20:g} MB of free disk wanted, so that its result has room"
                raise InvalidInput(f"{file.parent.parent}: {wish}, got {_free(file.parent.parent)}") from None

    def take(self) -> None:
        """Hold the room; raises OSError where there is none."""
        self._file.parent.mkdir(exist_ok=True)
        with plain_folder(self._file.parent) as folder:
            flags = os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW
            descriptor = os.open(self._file.name, flags, 0o600, dir_fd=folder)
        try:
            os.posix_fallocate(descriptor, 0, OPTIONS.bytes)
        finally:
            os.close(descriptor)

    def release(self) -> None:
        """Leave the room to what it was held for."""
        with suppress(OSError), plain_folder(self._file.parent) as folder:
            os.unlink(self._file.name, dir_fd=folder)


def _free(folder: Path) -> str:
    disk = os.statvfs(folder)
    return f"{disk.f_bavail * disk.f_frsize / 2**20:.2g} MB"
