"""Whether a signal asked the verb under way to stop: whatever takes long looks here, compiled code included.

``execution.interrupts`` sets it while a verb runs. Solvers then end with the iteration under way and raise
``Interrupted``; a verb that has something done by then returns that.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Number of the signal, 0 without one; an array, so that compiled code sees it change.
STOP = np.zeros(1, dtype=np.int64)
watched = False  # whether a signal sets it at once, while compiled code runs in the main thread too


class Interrupted(KeyboardInterrupt):
    """A signal came.

    ``partial`` is what a solver had by then, if anything, ``reason`` which limits did not hold yet, of which
    least-violating ``motion``.
    """

    def __init__(self, partial: Any = None, reason: str = "") -> None:
        self.partial, self.reason = partial, reason
        self.motion: Any = None
        super().__init__("interrupted")


def check_interruption() -> None:
    """Raise Interrupted where a signal came."""
    if STOP[0]:
        raise Interrupted
