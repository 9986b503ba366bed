"""The whole Pareto front of joint motions for a redundant arm.

The public names are in ``__init__.pyi``. Each is loaded when it is first used, so that ``import paretoik`` is quick.
"""

from typing import Any

import lazy_loader

from .capability.keepers import KEEPERS as _KEEPERS


def _keep_path(*arguments: Any, **named: Any) -> Any:
    """Return a tool path, kept in a run folder."""
    from .api.path_run import keep_path

    return keep_path(*arguments, **named)


_KEEPERS.append(_keep_path)  # its package is below ``api`` and cannot import it
__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
