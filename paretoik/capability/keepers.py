"""Functions that save tool paths in run folders; ``paretoik`` registers them here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

KEEPERS: list[Callable[..., Any]] = []
