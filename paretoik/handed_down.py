"""Functions of higher packages that lower ones call but cannot import; ``paretoik`` sets them.

keep_path: saves a tool path in a run folder
open_view, show_choice: show a front in a notebook, and its present choice in the recording of its run
link_bodies, body_table: return the convex bodies of a URDF's links, and a table of them
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

HANDED_DOWN: dict[str, Callable[..., Any]] = {}
