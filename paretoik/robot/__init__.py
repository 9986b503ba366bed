"""Arms, their kinematics and dynamics, and how they are made: from lengths, Denavit–Hartenberg tables or URDFs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["arms"])
