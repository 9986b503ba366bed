"""Motions sampled at a controller's rate, checked against its limits, and written to files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["controllers"])
