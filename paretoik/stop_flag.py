"""The flag by which a signal asks the running verb to stop.

Long computations check it, in compiled code too.

``runs.interruption`` sets it while a verb runs. Solvers then end with the present iteration and raise
``Interrupted``; a verb that already has results returns them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Number of the signal, 0 if none came; an array, so that compiled code sees changes.
STOP = np.zeros(1, dtype=np.int64)
watched = False  # whether signals set the flag at once, even while compiled code runs in the main thread


class Interrupted(KeyboardInterrupt):
    """A signal came.

    partial: result of a solver so far, if any
    reason: names of the limits that are not satisfied yet
    motion: least-violating motion
    """

    def __init__(self, partial: Any = None, reason: str = "") -> None:
        self.partial, self.reason = partial, reason
        self.motion: Any = None
        super().__init__("interrupted")


def check_interruption() -> None:
    """Raise Interrupted if a signal came."""
    if STOP[0]:
        raise Interrupted
