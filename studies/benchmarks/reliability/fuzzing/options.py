"""How long is fuzzed, and with what."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FuzzingOptions:
    """A target has so many ``seconds``, with --quick ``quick``; inputs are at most so long, ``longest`` [bytes].

    An input that takes ``hang`` seconds never ends. Of a robot so many chains are built, ``tips``.
    """

    seconds: int = 600
    quick: int = 10
    longest: int = 8192
    hang: int = 120
    tips: int = 3


OPTIONS = FuzzingOptions()
