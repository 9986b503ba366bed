"""The whole Pareto front of joint motions for a redundant arm.

The public names stand in ``__init__.pyi``. Each is loaded when it is first used, so that ``import paretoik`` is quick.
"""

import lazy_loader

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
