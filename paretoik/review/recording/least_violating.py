"""What is recorded where nothing is feasible: what comes nearest to it, and what that breaks."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.review.recording.recorded_point import RecordedPoint


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastViolating:
    """The individual or motion that breaks the constraints of a problem least, where none keeps them all.

    ``broken`` are those that it breaks, each by how much; at the end of a run there are the ``reason`` why it has no
    result, and what breaks least as a ``point``, None where there is no motion.
    """

    broken: tuple[str, ...]
    reason: str = ""
    point: RecordedPoint | None = None
