"""Tells whether a signal asked the verb under way to stop; long computations check it, compiled code included.

``runs.interruption`` sets it while a verb runs. Solvers then end with the present iteration and raise
``Interrupted``; a verb that has results by then returns them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Number of the signal, 0 without one; an array, so that compiled code sees it change.
STOP = np.zeros(1, dtype=np.int64)
watched = False  # whether a signal sets it at once, even while compiled code runs in the main thread


class Interrupted(KeyboardInterrupt):
    """A signal came.

    ``partial`` is the result of a solver so far, if any, ``reason`` names the limits that are not satisfied yet, and
    ``motion`` is the least-violating motion.
    """

    def __init__(self, partial: Any = None, reason: str = "") -> None:
        self.partial, self.reason = partial, reason
        self.motion: Any = None
        super().__init__("interrupted")


def check_interruption() -> None:
    """Raise Interrupted if a signal came."""
    if STOP[0]:
        raise Interrupted
