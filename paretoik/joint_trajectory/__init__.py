"""Motions as a robot's controller takes them: sampled at its rate, held against its limits, and written for it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["controllers"])
