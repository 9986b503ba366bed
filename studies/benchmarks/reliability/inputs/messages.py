"""Checks of a message: one line with the name of the thing, a wish, and a fact."""

from __future__ import annotations

import re
from dataclasses import dataclass

WISH = re.compile(r"\b(wanted|wants?|must)\b")
FACT = re.compile(r"\bgot\b")


@dataclass(frozen=True, kw_only=True)
class MessageOptions:
    """The most characters of a message: ``long``."""

    long: int = 400


OPTIONS = MessageOptions()


def message_faults(message: str, *, is_named: bool) -> list[str]:
    """Return the faults of a message; the caller says whether the thing is named."""
    faults = []
    if "\n" in message or len(message) > OPTIONS.long or not message.isprintable():
        faults.append("not one line")
    if not is_named:
        faults.append("no name")
    if not WISH.search(message):
        faults.append("no wish")
    if not FACT.search(message):
        faults.append("no fact")
    return faults
