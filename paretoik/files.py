"""Files that are replaced whole, so that no reader sees a part of one."""

from __future__ import annotations

import os
from pathlib import Path

from paretoik.errors import InvalidInput


def replace_file(file: Path, content: bytes) -> None:
    """Write ``content`` into a temporary file and rename it to ``file``; create missing folders.

    Raises
    ------
    InvalidInput
        The system refuses, for instance because the disk is full; the former file is unchanged.
    """
    part = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("wb") as sink:
                sink.write(content)
                sink.flush()
                os.fsync(sink.fileno())
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)
    except OSError as fault:
        raise InvalidInput(f"{file}: wanted to write it, got {fault.strerror}") from fault
