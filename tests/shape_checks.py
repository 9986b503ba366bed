"""What the tests hold annotations against: beartype, for which an int will do where a float is asked, as in PEP 484.

A check costs 25 µs, and loops call some functions 100 000 times in a test: of the calls of a function in one test the
first 100 are checked, then every hundredth.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Any

from beartype import BeartypeConf, beartype

CONFIGURATION = BeartypeConf(is_pep484_tower=True)
PERIOD = 100

_counters: dict[Callable[..., Any], itertools.count[int]] = {}


def restart() -> None:
    """Count the calls of every function from zero: a test begins."""
    _counters.clear()


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, with its arguments and results checked at its first calls in a test, and then at a few."""
    if "<locals>" in function.__qualname__:
        return function  # it is made anew at every call of what encloses it, and so would its checks be
    check = functools.cache(lambda: beartype(function, conf=CONFIGURATION))  # compiled at its first call, if any

    @functools.wraps(function)
    def check_some(*args: Any, **kwargs: Any) -> Any:
        counter = _counters.get(function)
        if counter is None:
            counter = _counters[function] = itertools.count()
        number = next(counter)
        return check()(*args, **kwargs) if number < PERIOD or number % PERIOD == 0 else None

    return check_some
