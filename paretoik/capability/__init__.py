"""What an arm can do: actuations, directional maxima, speed models and the fastest paths (Kim, Choi & Jang 2021).

The public names stand in ``__init__.pyi`` and are loaded when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
