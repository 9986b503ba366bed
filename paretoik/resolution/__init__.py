"""One motion locally, step by step: projection methods, predictive minimisation, Nedungadi."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["measures", "methods"])
