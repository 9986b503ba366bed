"""Shapes of links and obstacles, and distances between them."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submodules=["bodies", "hulls", "inflation", "meshes", "obstacles"]
)
