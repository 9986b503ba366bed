"""What the tests hold annotations against: beartype, for which an int will do where a float is asked, as in PEP 484."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from beartype import BeartypeConf, beartype

CONFIGURATION = BeartypeConf(is_pep484_tower=True)


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, with its arguments and results checked at every call."""
    if "<locals>" in function.__qualname__:
        return function  # it is made anew at every call of what encloses it, and so would its checks be
    return beartype(function, conf=CONFIGURATION)
