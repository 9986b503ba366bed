"""Faults and warnings of a URDF: each has the line that it is on, and of very many the first are listed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from paretoik.robot.urdf_description import LinkDescription

Fault: TypeAlias = tuple[int, str]
"""Line of the file, and message."""
NAMED = re.compile(
    r"(?:line \d+: )?(link|joint) ('(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"): (.*)"
)  # of what a message is
FACT = re.compile(r", got [^;]*")  # its own of each


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """So many faults, or warnings, are listed; of a group that says the same of several so many are ``named``."""

    max_messages: int = 100
    named: int = 3


OPTIONS = FaultOptions()


def inertia_faults(links: Iterable[LinkDescription]) -> list[Fault]:
    """Return the faults of the inertias of links."""
    return [link.inertia_fault for link in links if link.inertia_fault is not None]


def list_messages(messages: Iterable[Fault]) -> tuple[str, ...]:
    """Return messages by line, as text; of very many the first ``max_messages``."""
    ordered = sorted(messages, key=lambda message: message[0])
    excess = len(ordered) - OPTIONS.max_messages
    lines = [f"line {line}: {text}" for line, text in ordered[: OPTIONS.max_messages]]
    return (*lines, *([f"and {excess} more"] if excess > 0 else []))


def group_messages(messages: Iterable[str]) -> list[str]:
    """Return messages, what is said alike of several links or joints once: how many there are, and the first names.

    >>> group_messages([f"line {n}: link 'l{n}': mass wanted, got {n}; left out" for n in range(5)])
    ["each of 5 links, 'l0', 'l1', 'l2' and 2 more: mass wanted; left out"]
    """
    groups = dict[tuple[str, str], list[str]]()
    for message in messages:
        named = NAMED.fullmatch(message)
        key = ("", message) if named is None else (named[1], FACT.sub("", named[3]))
        groups.setdefault(key, []).append(message)
    return [each[0] if len(each) == 1 else _group_text(*key, each) for key, each in groups.items()]


def _group_text(kind: str, text: str, messages: Sequence[str]) -> str:
    """Return what messages say of several of a ``kind``: the first's whole text where all have it, else ``text``."""
    matches = [NAMED.fullmatch(message) for message in messages]
    names, texts = [each[2] for each in matches if each], {each[3] for each in matches if each}
    first, more = names[: OPTIONS.named], len(names) - OPTIONS.named
    listed = f"{', '.join(first)} and {more} more" if more > 0 else " and ".join([", ".join(first[:-1]), first[-1]])
    return f"each of {len(names)} {kind}s, {listed}: {texts.pop() if len(texts) == 1 else text}"
