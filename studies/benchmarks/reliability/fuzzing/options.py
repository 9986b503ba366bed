"""The durations and sizes of fuzzing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FuzzingOptions:
    """``seconds`` per target, ``quick`` with --quick; inputs have at most ``longest`` bytes.

    An input that takes ``hang`` seconds never ends. ``tips`` is the number of chains built from a robot.
    """

    seconds: int = 600
    quick: int = 10
    longest: int = 8192
    hang: int = 120
    tips: int = 3


OPTIONS = FuzzingOptions()
