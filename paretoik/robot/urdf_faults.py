"""Faults and warnings of a URDF: each has the line that it is on, and of very many the first are listed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

from paretoik.robot.urdf_description import LinkDescription

Fault: TypeAlias = tuple[int, str]
"""Line of the file, and message."""


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """So many faults, or warnings, are listed."""

    max_messages: int = 100


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
