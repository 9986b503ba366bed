"""Capability of an arm: actuations, directional maxima, speed models and fastest paths (Kim, Choi & Jang 2021).

The public names are in ``__init__.pyi``; each is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
