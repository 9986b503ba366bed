"""Local resolution of one motion: projection, quadratic program, prediction, Nedungadi's method."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["measures", "methods"])
