"""Faults and warnings of a URDF: each has the line that it is on, and of very many a text lists the first."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from paretoik.robot.urdf_description import Fault

LINK_OR_JOINT_MESSAGE = re.compile(r"(?:line \d+: )?(link|joint) ('(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"): (.*)")
GOT_CLAUSE = re.compile(r", got [^;]*")


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """How many faults, or warnings, a text lists, and of how many links or joints that have the same one the names."""

    listed_messages: int = 100
    listed_names: int = 3


OPTIONS = FaultOptions()


def list_messages(messages: Iterable[Fault]) -> tuple[str, ...]:
    """Return messages by line, as text."""
    return tuple(f"line {line}: {text}" for line, text in sorted(messages, key=lambda message: message[0]))


def shorten_list(messages: Sequence[str]) -> list[str]:
    """Return messages, of very many the first, and how many more there are."""
    excess = len(messages) - OPTIONS.listed_messages
    return [*messages[: OPTIONS.listed_messages], *([f"and {excess} more"] if excess > 0 else [])]


def group_messages(messages: Iterable[str]) -> list[str]:
    """Return messages, those of several links or joints that are the same once, with their number and the first names.

    >>> group_messages([f"line {n}: link 'l{n}': mass wanted, got {n}; left out" for n in range(5)])
    ["each of 5 links, 'l0', 'l1', 'l2' and 2 more: mass wanted; left out"]
    """
    groups = dict[tuple[str, str], list[str]]()
    for message in messages:
        match = LINK_OR_JOINT_MESSAGE.fullmatch(message)
        key = ("", message) if match is None else (match[1], GOT_CLAUSE.sub("", match[3]))
        groups.setdefault(key, []).append(message)
    return [each[0] if len(each) == 1 else _group_text(*key, each) for key, each in groups.items()]


def _group_text(kind: str, text: str, messages: Sequence[str]) -> str:
    """Return in one line the messages of several of a ``kind``: the whole text of all where it is one, else ``text``.

    Messages of neither links nor joints are in one group only where they are equal: the line is the message itself.
    """
    matches = [match for message in messages if (match := LINK_OR_JOINT_MESSAGE.fullmatch(message))]
    if not matches:
        return messages[0]
    names, texts = [match[2] for match in matches], {match[3] for match in matches}
    first, more = names[: OPTIONS.listed_names], len(names) - OPTIONS.listed_names
    listed = f"{', '.join(first)} and {more} more" if more > 0 else " and ".join([", ".join(first[:-1]), first[-1]])
    return f"each of {len(names)} {kind}s, {listed}: {texts.pop() if len(texts) == 1 else text}"
