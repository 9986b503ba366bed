"""Warnings to users, each at the line of theirs that led to it."""

from __future__ import annotations

import sys
import warnings

BETWEEN = ("paretoik", "contextlib", "functools")  # modules whose frames are no user's


def warn_user(text: str) -> None:
    """Warn with a RuntimeWarning, whose place is the innermost line outside of this package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in BETWEEN:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, RuntimeWarning, stacklevel=level)
