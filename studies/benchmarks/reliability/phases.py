"""The phases in which a run is killed."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

TimePhase: TypeAlias = Literal["ask", "evaluate", "refine", "else"]  # in seconds
FilePhase: TypeAlias = Literal["write", "rename", "fsync"]  # in numbers
Phase: TypeAlias = Literal["ask", "evaluate", "refine", "else", "write", "rename", "fsync"]

PHASES: tuple[Phase, ...] = get_args(Phase)
FILE_PHASES: tuple[FilePhase, ...] = get_args(FilePhase)
