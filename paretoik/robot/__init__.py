"""What moves: arms, their kinematics and dynamics, and where their descriptions come from."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["arms"])
