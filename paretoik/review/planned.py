"""What is recorded of a plan: its levels as they are done, and the motions of its optima."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.arrays import Values


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLevel:
    """A level of ``samples`` that is done, the ``number``-th from 0: the objective of its starts, and of its optima.

    Values are in the objective's own sign, of the optima best first.
    """

    number: int
    samples: int
    starts: Values
    optima: Values
