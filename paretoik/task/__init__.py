"""Motion problems: paths and their timing, motions, objectives, limits, obstacles, and the task that they make."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["obstacles"])
