"""What is asked: path, timing, motion, objectives, limits, obstacles, and the task they make."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["obstacles"])
