"""How a child process is started: Python's own and installed modules come first, a user's files last."""

from __future__ import annotations

import sys
from pathlib import Path


def child_command(module: str, *arguments: str) -> list[str]:
    """Return the command of a child that calls ``main`` of a module and finds the modules that this process finds.

    The folders that only this process knows, as that of a problem, come last: no file in them stands in for a module of
    Python or of a library.
    """
    places = [place or str(Path.cwd()) for place in sys.path]
    path = f"sys.path += [place for place in {places!r} if place not in sys.path]"
    return [sys.executable, "-P", "-c", f"import sys; {path}; from {module} import main; main()", *arguments]
