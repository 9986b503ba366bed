"""Shapes of obstacles, and distances of an arm's links from them."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["obstacles"])
