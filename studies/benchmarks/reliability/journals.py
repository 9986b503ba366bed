"""A real run's journal cut at every byte of its end, and with single bits flipped anywhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.journal import HEAD, MAGIC, Journal


def frame_ends(content: bytes) -> list[int]:
    """Return where the frames of a journal end; first where the first begins."""
    ends = [len(MAGIC)]
    while ends[-1] < len(content):
        ends.append(ends[-1] + HEAD.size + HEAD.unpack_from(content, ends[-1])[0])
    return ends


def count_wrong_cuts(content: bytes, part: Path, *, last: int) -> int:
    """Return at how many of the ``last`` bytes a cut journal has not exactly the frames that are whole."""
    ends = frame_ends(content)
    return sum(
        _entries(content[:length], part) != sum(length >= end for end in ends) - 1
        for length in range(max(len(content) - last, len(MAGIC)), len(content))
    )


def count_flips(content: bytes, part: Path, *, flips: int, seed: int = 0) -> dict[str, int]:
    """Return how many single flipped bits are refused, leave exactly what was before them, or neither."""
    ends, rng = frame_ends(content), np.random.default_rng(seed)
    counts = {"refused": 0, "what was before": 0, "wrong": 0}
    for bit in rng.choice(8 * len(content), flips, replace=False).tolist():
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        try:
            entries = _entries(bytes(damaged), part)
        except InvalidRun:
            counts["refused"] += 1
            continue
        before = sum(bit // 8 >= end for end in ends) - 1
        counts["what was before" if entries == before else "wrong"] += 1
    return counts


def _entries(content: bytes, part: Path) -> int:
    part.write_bytes(content)
    journal = Journal(part)
    entries = len(journal)
    journal.close()
    return entries
