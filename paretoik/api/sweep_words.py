"""What observers read of how an ε-sweep improves its front."""

from __future__ import annotations

from paretoik.pareto.sweep import SweepPhase


def phase_text(phase: SweepPhase) -> str:
    """Return what is done in a phase of a sweep, "" before its first.

    >>> phase_text("jump search")
    'jumps searched'
    """
    words: dict[SweepPhase, str] = {
        "": "",
        "gap filling": "better places sought",
        "jump search": "jumps searched",
        "basin exchange": "neighbours' basins tried",
    }
    return words[phase]
