"""The errors that a caller can cause, as one tree.

::

    ParetoikError
    ├── InvalidInput (also ValueError)   an input cannot be used                 exit code 2
    │   ├── InvalidRobot                 a robot description with its faults
    │   ├── OutOfReach                   a path that the arm cannot follow
    │   └── InvalidRun                   a run folder that is damaged or invalid
    ├── Infeasible                       no motion satisfies the limits          exit code 3
    ├── EvaluationFailed                 no evaluation gave a usable number      exit code 4
    └── SolverFailed                     a solver ended without a solution       exit code 4

Every message is one line: the name of the thing, what it must be, what it is.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence

__all__ = [
    "EvaluationFailed",
    "Infeasible",
    "InvalidInput",
    "InvalidRobot",
    "InvalidRun",
    "OutOfReach",
    "ParetoikError",
    "SolverFailed",
]


def __dir__() -> list[str]:
    return __all__


# Warnings to users: each is attributed to the line of their code that caused it.


BETWEEN = ("paretoik", "contextlib", "functools")  # modules whose frames are never a user's code


def warn_user(text: str) -> None:
    """Issue a RuntimeWarning at the innermost line outside this package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in BETWEEN:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, RuntimeWarning, stacklevel=level)


# The tree of errors.


class ParetoikError(Exception):
    """Base of every error that paretoik raises on purpose.

    partial: result of the verb so far, or None
    """

    partial: object = None

    exit_code = 1

    def __init__(self, message: str = "") -> None:
        line = " ".join(message.split())  # error texts of libraries may have several lines and unprintable bytes
        super().__init__("".join(letter if letter.isprintable() else "?" for letter in line))


class InvalidInput(ParetoikError, ValueError):  # noqa: N818  the name says what it is; "Error" would add nothing
    """An input cannot be used; nothing was computed."""

    exit_code = 2


class InvalidRobot(InvalidInput):
    """A robot description has ``faults``; the message lists the first 100."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.source = source
        self.faults = tuple(faults)
        count = "1 fault" if len(self.faults) == 1 else f"{len(self.faults)} faults"
        more = [f"and {len(self.faults) - 100} more"] if len(self.faults) > 100 else []
        text = "; ".join([*self.faults[:100], *more])
        super().__init__(f"{source} must be a robot without faults, got {count}: {text}")


class OutOfReach(InvalidInput):
    """A path that leaves the reach of the arm.

    sample: index of the first sample out of reach
    """

    def __init__(self, message: str, *, sample: int) -> None:
        self.sample = sample
        super().__init__(message)


class InvalidRun(InvalidInput):
    """A folder that is not a run, or a run that is damaged or of another version."""


class Infeasible(ParetoikError):  # noqa: N818
    """No motion satisfies every limit.

    motion: least-violating motion, None if not even the path could be followed
    limit: name of the limit that binds
    violation: violation of that limit, as a share of its range
    """

    exit_code = 3

    def __init__(
        self, message: str, *, motion: object = None, limit: str = "", violation: float = float("nan")
    ) -> None:
        self.motion = motion
        self.limit = limit
        self.violation = violation
        super().__init__(message)


class EvaluationFailed(ParetoikError):  # noqa: N818
    """No evaluation gave a usable number; the message names the first cause."""

    exit_code = 4


class SolverFailed(ParetoikError):  # noqa: N818
    """A solver ended without a solution, although one may exist. The message has the solver's name and its status."""

    exit_code = 4
