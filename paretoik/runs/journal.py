"""The journal of a run: computed values by keys of inputs.

Values are appended when they are computed, so that none is computed twice. A run that was stopped or killed starts
again with its journal: it takes the values of equal inputs from there, and computes the others. Values depend on their
inputs only, so the result is, bit for bit, that of a run that never stopped.

The file is a sequence of frames: `MARK`; the key (32 bytes); the length of the payload (8 bytes, little-endian); the
SHA-256 digest of key and payload; and the payload: NumPy arrays one after the other, the first with the names of the
others. Every frame can be read separately. If one is damaged, the next frame begins at the next `MARK`, and the damaged
content is computed again. An incomplete frame at the end, from a killed process, is cut off.
"""

from __future__ import annotations

import hashlib
import io
import mmap
import os
import struct
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.lib.format import read_array, write_array

from paretoik.errors import InvalidRun, warn_user
from paretoik.runs.file_replacement import refusal
from paretoik.stop_flag import STOP

MARK = b"paretoik journal 3\n"  # the first bytes of every frame
HEAD = struct.Struct(f"<{len(MARK)}s32sQ32s")  # head of a frame

Values: TypeAlias = Mapping[str, np.ndarray]
Compute: TypeAlias = Callable[[], Values]


class Journal:
    """The journal in a file, which is made if it is missing; the caller must hold the lock of its folder.

    Warns of damaged frames. Raises InvalidRun if the file is not a journal; InvalidInput if the system refuses it.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._places: dict[bytes, tuple[int, int]] = {}  # offset and length of a payload, by its key
        self._is_full = False
        self._end = 0  # end of the last intact frame
        with refusal(f"{file} must be writable"):
            file.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        self._synced = time.monotonic()
        size, damaged = os.fstat(self._descriptor).st_size, 0
        if not size:
            return
        # Find all intact frames; cut off everything after the last one.
        with mmap.mmap(self._descriptor, size, access=mmap.ACCESS_READ) as content:
            place = content.find(MARK)
            while place >= 0 and place + HEAD.size <= size:
                _, key, length, digest = HEAD.unpack_from(content, place)
                begin = place + HEAD.size
                if length <= size - begin and digest == _digest(key, content[begin : begin + length]):
                    self._places[key] = (begin, length)
                    damaged += place - self._end
                    self._end = begin + length
                place = content.find(MARK, max(self._end, place + 1))
            if not self._places and content[: len(MARK)] != MARK[:size]:
                os.close(self._descriptor)
                raise InvalidRun(f"{file} must be the journal of a run, got something else")
        os.ftruncate(self._descriptor, self._end)
        if damaged:
            warn_user(f"{file}: {damaged} of {size} bytes are damaged; their content is computed again")

    @property
    def keys(self) -> Collection[bytes]:
        """The keys of all frames."""
        return self._places.keys()

    def get(self, key: bytes) -> dict[str, np.ndarray] | None:
        """Return the values of a key, None if it has none."""
        if key not in self._places:
            return None
        offset, length = self._places[key]
        payload = io.BytesIO(os.pread(self._descriptor, length, offset))
        names = read_array(payload, allow_pickle=False)
        return {str(name): read_array(payload, allow_pickle=False) for name in names}

    def append(self, key: bytes, values: Values) -> None:
        """Append values under a key; on a full disk a warning says that no more are kept, and the run continues."""
        with self._lock:
            if self._is_full or key in self._places:
                return
            payload = io.BytesIO()
            for array in (np.array([*values], dtype=np.str_), *values.values()):
                write_array(payload, np.asarray(array, order="C"), allow_pickle=False)
            content = payload.getvalue()
            frame = HEAD.pack(MARK, key, len(content), _digest(key, content)) + content
            try:
                written = 0
                while written < len(frame):
                    written += os.pwrite(self._descriptor, frame[written:], self._end + written)
                self._sync(every=1.0)  # s: a frame survives a killed process at once, a power cut only on the disk
            except OSError as fault:
                self._is_full = True
                os.ftruncate(self._descriptor, self._end)
                text = f"{self._file}: the run continues, but cannot be resumed from here on: {fault.strerror}"
                warn_user(text)
                return
            self._places[key] = (self._end + HEAD.size, len(content))
            self._end += len(frame)

    def close(self) -> None:
        """Write everything to the disk and close the file."""
        with suppress(OSError):  # lost values are computed again
            self._sync(every=0.0)
        os.close(self._descriptor)

    def _sync(self, *, every: float) -> None:
        if time.monotonic() - self._synced >= every:
            os.fsync(self._descriptor)
            self._synced = time.monotonic()


_ACTIVE: list[Journal] = []  # one at most: a process computes one run at a time


@contextmanager
def journalled(file: Path | None) -> Iterator[Journal | None]:
    """Use the journal in a file, if any, while the body runs; if another one is in use, that one is kept."""
    if file is None or _ACTIVE:
        yield None
        return
    journal = Journal(file)
    _ACTIVE.append(journal)
    try:
        yield journal
    finally:
        _ACTIVE.pop()
        journal.close()


@contextmanager
def without_journal() -> Iterator[None]:
    """Use no journal in the body, as when values depend on time."""
    active = _ACTIVE.copy()
    _ACTIVE.clear()
    try:
        yield
    finally:
        _ACTIVE.extend(active)


def is_journalled() -> bool:
    """Return whether computed values go into a journal."""
    return bool(_ACTIVE)


def remembered(key: bytes | None, compute: Compute) -> Values:
    """Return a key's values from the journal, or from ``compute``.

    Computed values go into the journal. The key is the digest of all inputs, None if nothing is to be remembered.
    Values are plain arrays by name. Values computed after a signal may be incomplete and are not remembered.
    """
    if not _ACTIVE or key is None:
        return compute()
    journal = _ACTIVE[0]
    stored = journal.get(key)
    if stored is not None:
        return stored
    values = compute()
    if not STOP[0]:
        journal.append(key, values)
    return values


def recalled(key: bytes) -> Values | None:
    """Return a key's values from the journal; None if there is no journal or no values."""
    return _ACTIVE[0].get(key) if _ACTIVE else None


def key_of(kind: str, *inputs: object) -> bytes:
    """Return the digest of inputs. Arrays count by type, shape and bits, others by their text."""
    digest = hashlib.sha256(kind.encode())
    for each in inputs:
        if isinstance(each, np.ndarray):
            digest.update(f"\0{each.dtype.str}{each.shape}\0".encode())
            digest.update(np.ascontiguousarray(each).tobytes())
        else:
            digest.update(f"\0{each!r}\0".encode())
    return digest.digest()


def _digest(key: bytes, content: bytes) -> bytes:
    return hashlib.sha256(key + content).digest()
