"""Who keeps tool paths in run folders: it lies above this package, and ``paretoik`` hands it over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

KEEPERS: list[Callable[..., Any]] = []
