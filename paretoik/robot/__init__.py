"""Arms from lengths, Denavit–Hartenberg tables or URDFs; kinematics and dynamics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["arms"])
