"""The process's stdout and stderr: what they refuse ends no command, and what they cannot encode is written plainly."""

from __future__ import annotations

import codecs
import errno
import os
import select
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput

PLAIN = str.maketrans(  # what no decomposition leads to
    dict(zip("−–×·", "--x*", strict=True))
    | {"ε": "eps", "χ": "chi", "π": "pi", "∂": "d", "≤": "<=", "≥": ">=", "°": " deg", "“": '"', "”": '"'}
)
STDIN, STDOUT, STDERR = 0, 1, 2  # descriptors of the process


@contextmanager
def process_output() -> Iterator[None]:
    """Let the body write to the process's stdout and stderr whatever these are: full, closed, without letters or gone.

    Raises InvalidInput at the end of a body that ends well, or with an exit, where stdout did not take all. Who reads
    it may go at any time, though, and nobody reads one that is closed.
    """
    _open_missing_descriptors()
    codecs.register_error("paretoik.plain", _plain_letters)
    sys.stderr = _lenient(sys.stderr, sys.__stderr__, STDERR)
    sys.stdout = _lenient(sys.stdout, sys.__stdout__, STDOUT)
    try:
        yield
    except SystemExit:
        _check_written(sys.stdout)
        raise
    _check_written(sys.stdout)


class _LenientFile(FileIO):
    """A descriptor whose refusals are remembered, not raised."""

    fault: OSError | None = None  # the first

    def write(self, content: Any) -> int:
        """Write what the system takes, and drop what it refuses."""
        try:
            while (written := super().write(content)) is None:  # another process made it one that does not wait
                select.select([], [self], [])
        except OSError as fault:
            self.fault = self.fault or fault
            return len(content)
        return written


def _lenient(stream: Any, original: Any, descriptor: int) -> Any:
    """Return a stream to a descriptor that never raises, in place of the process's own; others are left as they are."""
    if stream is None:
        return Path(os.devnull).open("w", encoding="utf-8")  # for the rest of the process
    if stream is not original or not isinstance(stream, TextIOWrapper):
        return stream
    file = BufferedWriter(_LenientFile(descriptor, "wb", closefd=False))
    return TextIOWrapper(
        file, stream.encoding, "paretoik.plain", line_buffering=stream.line_buffering or descriptor == STDERR
    )


def _check_written(stream: Any) -> None:
    """Have all written; raises InvalidInput where a reader who is still there did not get it."""
    file = getattr(getattr(stream, "buffer", None), "raw", None)
    if not isinstance(file, _LenientFile):
        return
    stream.flush()
    if file.fault is not None and file.fault.errno != errno.EPIPE:
        raise InvalidInput(f"stdout: wanted to print all that there is to say, got {file.fault.strerror}")


def _open_missing_descriptors() -> None:
    """Let descriptors that are closed lead nowhere: the next file that is opened would be printed into."""
    for descriptor in (STDIN, STDOUT, STDERR):
        try:
            os.fstat(descriptor)
        except OSError:  # the lowest that is free is what is opened next
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)


def _plain_letters(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    letters = unicodedata.normalize("NFKD", error.object[error.start : error.end])
    plain = letters.translate(PLAIN).encode("ascii", "replace")
    return plain.decode(), error.end
