"""What a process that is started for a run finds of the one that starts it."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def child_environment() -> dict[str, str]:
    """Return the environment of a child that runs this Python: it finds the modules that this process finds."""
    places = [place or str(Path.cwd()) for place in sys.path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
