"""A real run's journal cut at every byte of its end, and with a bit flipped in every field of every frame."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Set
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.runs.files import CHECKPOINT, JOURNAL
from paretoik.runs.journal import HEAD, MARK, Journal

FIELDS = len(MARK), 32, 8, 32  # bytes of a frame's mark, key, length and digest


def frame_ends(content: bytes) -> list[int]:
    """Return the ends of a journal's frames, first 0."""
    ends = [0]
    while ends[-1] < len(content):
        ends.append(ends[-1] + HEAD.size + HEAD.unpack_from(content, ends[-1])[2])
    return ends


def count_wrong_cuts(content: bytes, part: Path, *, last: int) -> int:
    """Return the number of the ``last`` bytes at which a cut journal lacks a whole frame or has another."""
    ends, keys = frame_ends(content), _keys(content, part)
    return sum(
        set(_keys(content[:length], part)) != set(keys[: sum(length >= end for end in ends) - 1])
        for length in range(max(len(content) - last, 0), len(content))
    )


def count_flips(content: bytes, part: Path, *, seed: int = 0) -> dict[str, int]:
    """Return the numbers of fields whose flipped bit costs its own frame only, is refused, or costs another frame."""
    ends, keys, rng = frame_ends(content), _keys(content, part), np.random.default_rng(seed)
    counts = {"its own frame": 0, "refused": 0, "wrong": 0}
    for frame, begin in enumerate(ends[:-1]):
        for first, last in fields(begin, ends[frame + 1]):
            damaged = bytearray(content)
            damaged[rng.integers(first, last)] ^= 1 << int(rng.integers(8))
            try:
                intact: Set[bytes] = set(_keys(bytes(damaged), part))
            except InvalidRun:
                counts["refused"] += 1
                continue
            counts["its own frame" if intact == set(keys) - {keys[frame]} else "wrong"] += 1
    return counts


def fields(begin: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield the places of a frame's fields: mark, key, length, digest, payload."""
    yield from pairwise([*accumulate(FIELDS, initial=begin), end])


def damage(folder: Path, *, seed: int) -> None:
    """Flip one bit anywhere in the journal of a run."""
    file, rng = folder / CHECKPOINT / JOURNAL, np.random.default_rng(seed)
    content = bytearray(file.read_bytes())
    if content:
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        file.write_bytes(content)


def _keys(content: bytes, part: Path) -> list[bytes]:
    """Return the keys of the intact frames of a journal, in order."""
    part.write_bytes(content)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*are damaged")
        journal = Journal(part)
    keys = list(journal.keys)
    journal.close()
    return keys
