"""The journal of a run: what was computed from what, appended as it comes, so that nothing need be computed twice.

A run that was stopped, or killed, is begun again with its journal: whatever is asked of it with the same inputs is
there, and the rest is computed. What depends on its inputs alone comes out the same, bit for bit, as in a run that
never stopped.

The file begins with `MAGIC`; then come frames: the length of the payload (8 bytes, little-endian), the SHA-256 digest
of the digest before, that length and the payload, and the payload: the length of its head (4 bytes), the head as JSON,
the key and the name, type and shape of every array, and their bytes. A frame at the end that is cut or damaged is what
a killed process was writing, and is cut off; damage further ahead is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.file_replacement import plain_folder, refusal
from paretoik.stop_flag import STOP
from paretoik.user_warnings import warn_user

MAGIC = b"paretoik journal 1\n"
HEAD = struct.Struct("<Q32s")  # of a frame
LENGTH = struct.Struct("<I")  # of the head of a payload
KINDS = "biufU"  # of arrays that are plain numbers or text

Values: TypeAlias = Mapping[str, np.ndarray]
Compute: TypeAlias = Callable[[], Values]


@dataclass(frozen=True, kw_only=True)
class JournalOptions:
    """Frames are on the disk after so many seconds (``sync``) at most; before, they survive the process alone."""

    sync: float = 1.0


OPTIONS = JournalOptions()


class Journal:
    """The journal in a file, which is made if need be. Whoever opens one holds the lock of its folder.

    Raises InvalidRun where the file is no journal, or damaged; InvalidInput where the system refuses it.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._places: dict[bytes, tuple[int, int]] = {}  # offset and length of a payload, by its key
        self._is_full = False
        self._end, self._digest = len(MAGIC), hashlib.sha256(MAGIC).digest()  # of the last whole frame
        with refusal(f"{file}: wanted to write the journal of a run"):
            file.parent.mkdir(parents=True, exist_ok=True)
            # Opened by hand because a link in its place, or in that of its folder, must not be followed.
            with plain_folder(file.parent) as folder:
                flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
                self._descriptor = os.open(file.name, flags, 0o666, dir_fd=folder)
        try:
            self._read()
        except BaseException:
            os.close(self._descriptor)
            raise
        self._synced = time.monotonic()

    def __len__(self) -> int:
        return len(self._places)

    def get(self, key: bytes) -> dict[str, np.ndarray] | None:
        """Return what was appended under a key, None where nothing was."""
        place = self._places.get(key)
        if place is None:
            return None
        offset, length = place
        return _decode(os.pread(self._descriptor, length, offset))

    def append(self, key: bytes, values: Values) -> None:
        """Append values under a key. On a full disk a warning says that no more is kept, and the run goes on."""
        with self._lock:
            if self._is_full or key in self._places:
                return
            payload = _encode(key, values)
            digest = _digest(self._digest, payload)
            frame = HEAD.pack(len(payload), digest) + payload
            try:
                _write_at(self._descriptor, frame, self._end)
                self._sync(every=OPTIONS.sync)
            except OSError as fault:
                self._is_full = True
                os.ftruncate(self._descriptor, self._end)
                text = f"{self._file}: the run goes on, but cannot be resumed from here on: {fault.strerror}"
                warn_user(text)
                return
            self._places[key] = (self._end + HEAD.size, len(payload))
            self._digest, self._end = digest, self._end + len(frame)

    def close(self) -> None:
        """Have everything on the disk and close the file."""
        with suppress(OSError):  # what is lost is computed again
            self._sync(every=0.0)
        os.close(self._descriptor)

    def _sync(self, *, every: float) -> None:
        if time.monotonic() - self._synced >= every:
            os.fsync(self._descriptor)
            self._synced = time.monotonic()

    def _read(self) -> None:
        """Find all frames; cut what a killed process was writing."""
        size = os.fstat(self._descriptor).st_size
        begin = os.pread(self._descriptor, len(MAGIC), 0)
        if begin != MAGIC[: len(begin)]:
            raise InvalidRun(f"{self._file}: wanted the journal of a run, got something else")
        if len(begin) < len(MAGIC):
            os.ftruncate(self._descriptor, 0)
            _write_at(self._descriptor, MAGIC, 0)
            return
        for offset, payload, digest in self._frames(size):
            try:
                key = _decode_head(payload)[0]
            except (ValueError, TypeError, RecursionError) as fault:
                raise InvalidRun(f"{self._file}: wanted arrays at byte {offset}, got {fault}") from fault
            self._places[key] = (offset, len(payload))
            self._digest, self._end = digest, offset + len(payload)
        os.ftruncate(self._descriptor, self._end)

    def _frames(self, size: int) -> Iterator[tuple[int, bytes, bytes]]:
        """Yield the offset, the payload and the digest of every whole frame; raise InvalidRun for a damaged one."""
        end, before = self._end, self._digest
        while end + HEAD.size <= size:
            length, digest = HEAD.unpack(os.pread(self._descriptor, HEAD.size, end))
            offset = end + HEAD.size
            if offset + length > size:
                return
            payload = os.pread(self._descriptor, length, offset)
            if _digest(before, payload) != digest:
                if offset + length == size:
                    return
                raise InvalidRun(f"{self._file}: wanted it as it was written, got one that is damaged at byte {end}")
            yield offset, payload, digest
            end, before = offset + length, digest


_ACTIVE: list[Journal] = []  # at most one: a process does one run at a time


@contextmanager
def journalled(file: Path | None) -> Iterator[Journal | None]:
    """Let what the body computes be remembered in a file, and what is there be taken from it; None remembers nothing.

    Within another journal's body it is that one. Raises as ``Journal``.
    """
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


def is_journalled() -> bool:
    """Say whether what is computed is remembered."""
    return bool(_ACTIVE)


def remembered(key: bytes | None, compute: Compute) -> Values:
    """Return what the journal has under a key, else what ``compute`` returns, which goes into the journal.

    The key is that of all it is computed from, None where nothing is to be remembered. Values are plain arrays by name.
    What comes after a signal may have been cut short, and is not remembered.
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
    """Return what the journal has under a key, None where it has nothing, or where there is no journal."""
    return _ACTIVE[0].get(key) if _ACTIVE else None


def key_of(kind: str, *inputs: object) -> bytes:
    """Return the digest of inputs: arrays by their type, shape and bits, others by their text."""
    digest = hashlib.sha256(kind.encode())
    for each in inputs:
        if isinstance(each, np.ndarray):
            digest.update(f"\0{each.dtype.str}{each.shape}\0".encode())
            digest.update(np.ascontiguousarray(each).tobytes())
        else:
            digest.update(f"\0{each!r}\0".encode())
    return digest.digest()


def _digest(before: bytes, payload: bytes) -> bytes:
    return hashlib.sha256(before + struct.pack("<Q", len(payload)) + payload).digest()


def _write_at(descriptor: int, content: bytes, offset: int) -> None:
    while content:
        written = os.pwrite(descriptor, content, offset)
        content, offset = content[written:], offset + written


def _encode(key: bytes, values: Values) -> bytes:
    arrays = {name: np.ascontiguousarray(value).reshape(np.shape(value)) for name, value in values.items()}
    for name, array in arrays.items():
        if array.dtype.kind not in KINDS:
            raise InvalidInput(f"journal: numbers and text wanted, got {array.dtype} for {name!r}")
    columns = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    head = json.dumps([key.hex(), columns]).encode()
    return b"".join([LENGTH.pack(len(head)), head, *(array.tobytes() for array in arrays.values())])


def _decode_head(payload: bytes) -> tuple[bytes, list[tuple[str, np.dtype[Any], tuple[int, ...]]], int]:
    """Return the key of a frame, the name, type and shape of its arrays, and where these begin; raises ValueError."""
    (length,) = LENGTH.unpack_from(payload.ljust(LENGTH.size, b"\0"))
    begin = LENGTH.size + length
    key, columns = json.loads(payload[LENGTH.size : begin])
    arrays = [(str(name), np.dtype(kind), tuple(shape)) for name, kind, shape in columns]
    sizes = [kind.itemsize * math.prod(shape) for _, kind, shape in arrays]
    plain = all(kind.kind in KINDS and all(type(n) is int and n >= 0 for n in shape) for _, kind, shape in arrays)
    if not plain or begin + sum(sizes) != len(payload):
        raise ValueError("arrays that are not there")
    return bytes.fromhex(key), arrays, begin


def _decode(payload: bytes) -> dict[str, np.ndarray]:
    _, arrays, offset = _decode_head(payload)
    values: dict[str, np.ndarray] = {}
    for name, kind, shape in arrays:
        count = math.prod(shape)
        values[name] = np.frombuffer(payload, kind, count, offset).reshape(shape).copy()
        offset += count * kind.itemsize
    return values
