"""The journal of a run: computed values by their inputs, appended as they come, so that none is computed twice.

A run that was stopped or killed starts again with its journal: it takes from there what it computed before from the
same inputs, and computes the rest. Values depend on their inputs only, so the result is the same, bit for bit, as that
of a run that never stopped.

The file is a row of frames: `MARK`; the length of the payload (8 bytes, little-endian); the SHA-256 digest of that
length and the payload; and the payload: the length of its head (4 bytes), the head as JSON (the key, and the name, type
and shape of every array), and the bytes of the arrays. Every frame can be read alone. If one is damaged, the next
`MARK` begins the next one, and the content of the damaged one is computed again. A half-written frame at the end, from
a process that was killed, is cut off.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from paretoik.errors import InvalidInput, InvalidRun, warn_user
from paretoik.runs.file_replacement import plain_folder, refusal
from paretoik.stop_flag import STOP

MARK = b"paretoik journal 2\n"  # the first bytes of every frame
HEAD = struct.Struct(f"<{len(MARK)}sQ32s")  # of a frame
LENGTH = struct.Struct("<I")  # of the head of a payload
KINDS = "biufU"  # of arrays that are plain numbers or text

Values: TypeAlias = Mapping[str, np.ndarray]
Compute: TypeAlias = Callable[[], Values]


@dataclass(frozen=True, kw_only=True)
class JournalOptions:
    """Settings of a journal.

    sync: longest time [s] until a frame is on the disk; before that it survives the process only
    largest: most bytes of a frame
    chunk: bytes read at a time in the search for the frame after a damaged one
    """

    sync: float = 1.0
    largest: int = 2**30
    chunk: int = 2**20


OPTIONS = JournalOptions()


class Journal:
    """The journal in a file, which is made if it is missing. The caller holds the lock of its folder.

    Warns of damaged frames. Raises InvalidRun if the file is no journal, InvalidInput if the system refuses it.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._places: dict[bytes, tuple[int, int]] = {}  # offset and length of a payload, by its key
        self._is_full = False
        self._end = 0  # of the last intact frame
        with refusal(f"{file} must be writable"):
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

    @property
    def keys(self) -> Collection[bytes]:
        """The keys of all frames."""
        return self._places.keys()

    def get(self, key: bytes) -> dict[str, np.ndarray] | None:
        """Return the values of a key, None if it has none."""
        place = self._places.get(key)
        if place is None:
            return None
        offset, length = place
        return _decode(os.pread(self._descriptor, length, offset))

    def append(self, key: bytes, values: Values) -> None:
        """Append values under a key. On a full disk a warning says that no more is kept, and the run continues."""
        with self._lock:
            if self._is_full or key in self._places:
                return
            payload = _encode(key, values)
            if len(payload) > OPTIONS.largest:  # a resumed run computes it again
                return
            frame = HEAD.pack(MARK, len(payload), _digest(payload)) + payload
            try:
                _write_at(self._descriptor, frame, self._end)
                self._sync(every=OPTIONS.sync)
            except OSError as fault:
                self._is_full = True
                os.ftruncate(self._descriptor, self._end)
                text = f"{self._file}: the run continues, but cannot be resumed from here on: {fault.strerror}"
                warn_user(text)
                return
            self._places[key] = (self._end + HEAD.size, len(payload))
            self._end += len(frame)

    def close(self) -> None:
        """Write everything to the disk and close the file."""
        with suppress(OSError):  # what is lost is computed again
            self._sync(every=0.0)
        os.close(self._descriptor)

    def _sync(self, *, every: float) -> None:
        if time.monotonic() - self._synced >= every:
            os.fsync(self._descriptor)
            self._synced = time.monotonic()

    def _read(self) -> None:
        """Find all intact frames; cut off what follows the last."""
        size, damaged = os.fstat(self._descriptor).st_size, 0
        for offset, payload in self._frames(size):
            try:
                key = _decode_head(payload)[0]
            except (ValueError, TypeError, SyntaxError, RecursionError) as fault:
                raise InvalidRun(f"{self._file} must hold arrays at byte {offset}, got {fault}") from fault
            self._places[key] = (offset, len(payload))
            damaged += offset - HEAD.size - self._end
            self._end = offset + len(payload)
        begin = os.pread(self._descriptor, len(MARK), 0)
        if not self._places and begin != MARK[: len(begin)]:
            raise InvalidRun(f"{self._file} must be the journal of a run, got something else")
        os.ftruncate(self._descriptor, self._end)
        if damaged:
            warn_user(f"{self._file}: {damaged} of {size} bytes are damaged; their content is computed again")

    def _frames(self, size: int) -> Iterator[tuple[int, bytes]]:
        """Yield the offset and the payload of every intact frame."""
        place = 0
        while (place := self._next_mark(place, size)) < size:
            head = os.pread(self._descriptor, HEAD.size, place)
            offset = place + HEAD.size
            length, digest = HEAD.unpack(head)[1:] if len(head) == HEAD.size else (size, b"")
            if length <= min(OPTIONS.largest, size - offset):
                payload = os.pread(self._descriptor, length, offset)
                if _digest(payload) == digest:
                    yield offset, payload
                    place = offset + length
                    continue
            place += 1

    def _next_mark(self, begin: int, size: int) -> int:
        """Return the offset of the first mark from a byte on, or the size of the file.

        Raises InvalidRun if the mark is further away than any frame is long: no run wrote that.
        """
        if os.pread(self._descriptor, len(MARK), begin) == MARK:
            return begin
        for place in range(begin, min(begin + OPTIONS.largest, size), OPTIONS.chunk):
            found = os.pread(self._descriptor, OPTIONS.chunk + len(MARK) - 1, place).find(MARK)
            if found >= 0:
                return place + found
        if size - begin > OPTIONS.largest:
            raise InvalidRun(f"{self._file} must be the journal of a run, got {size - begin} bytes at byte {begin}")
        return size


_ACTIVE: list[Journal] = []  # at most one: a process does one run at a time


@contextmanager
def journalled(file: Path | None) -> Iterator[Journal | None]:
    """Remember what the body computes in a file, and take from it what is there; None remembers nothing.

    Within another journal's body that journal is used. Raises as ``Journal``.
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


@contextmanager
def without_journal() -> Iterator[None]:
    """Use no journal for what the body computes, because it depends on the clock, for instance."""
    active = _ACTIVE.copy()
    _ACTIVE.clear()
    try:
        yield
    finally:
        _ACTIVE.extend(active)


def is_journalled() -> bool:
    """Return whether computed values are remembered."""
    return bool(_ACTIVE)


def remembered(key: bytes | None, compute: Compute) -> Values:
    """Return the values of a key in the journal, else those of ``compute``, which go into the journal.

    The key is that of all inputs, None if nothing is to be remembered. Values are plain arrays by name. Values computed
    after a signal may have been cut short, and are not remembered.
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
    """Return the values of a key in the journal; None without values or without a journal."""
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


def _digest(payload: bytes) -> bytes:
    digest = hashlib.sha256(struct.pack("<Q", len(payload)))
    digest.update(payload)
    return digest.digest()


def _write_at(descriptor: int, content: bytes, offset: int) -> None:
    while content:
        written = os.pwrite(descriptor, content, offset)
        content, offset = content[written:], offset + written


def _encode(key: bytes, values: Values) -> bytes:
    arrays = {name: np.ascontiguousarray(value).reshape(np.shape(value)) for name, value in values.items()}
    for name, array in arrays.items():
        if array.dtype.kind not in KINDS:
            raise InvalidInput(f"journal values must be numbers or text, got {array.dtype} for {name!r}")
    columns = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    head = json.dumps([key.hex(), columns]).encode()
    return b"".join([LENGTH.pack(len(head)), head, *(array.tobytes() for array in arrays.values())])


def _decode_head(payload: bytes) -> tuple[bytes, list[tuple[str, np.dtype[Any], tuple[int, ...]]], int]:
    """Return a frame's key, the name, type and shape of its arrays, and their offset; raises ValueError."""
    (length,) = LENGTH.unpack_from(payload.ljust(LENGTH.size, b"\0"))
    begin = LENGTH.size + length
    key, columns = json.loads(payload[LENGTH.size : begin])
    arrays = [(str(name), np.dtype(kind), tuple(shape)) for name, kind, shape in columns]
    sizes = [kind.itemsize * math.prod(shape) for _, kind, shape in arrays]
    plain = all(kind.kind in KINDS and kind.itemsize > 0 for _, kind, _ in arrays)
    plain = plain and all(type(length) is int for *_, shape in arrays for length in shape)
    if not plain or begin + sum(sizes) != len(payload):
        raise ValueError("arrays that are not there")
    for _, kind, shape in arrays:
        np.broadcast_to(np.empty((), kind), shape)  # raises ValueError for more dimensions than NumPy has
    return bytes.fromhex(key), arrays, begin


def _decode(payload: bytes) -> dict[str, np.ndarray]:
    _, arrays, offset = _decode_head(payload)
    values: dict[str, np.ndarray] = {}
    for name, kind, shape in arrays:
        count = math.prod(shape)
        values[name] = np.frombuffer(payload, kind, count, offset).reshape(shape).copy()
        offset += count * kind.itemsize
    return values
