"""Motions as a robot's controller takes them: sampled at its rate, checked against its limits, and written to files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["controllers"])
