"""Checks of a message: one line with the name of the thing, a wish, and a fact."""

from __future__ import annotations

import re

WISH = re.compile(r"\b(wanted|wants?|must)\b")
FACT = re.compile(r"\bgot\b")


def message_faults(message: str, *, is_named: bool) -> list[str]:
    """Return the faults of a message; the caller says whether the thing is named."""
    faults = []
    if not message.isprintable():
        faults.append("not one line")
    if not is_named:
        faults.append("no name")
    if not WISH.search(message):
        faults.append("no wish")
    if not FACT.search(message):
        faults.append("no fact")
    return faults
