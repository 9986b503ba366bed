"""Shape checks of the tests: beartype, for which an int will do where a float is asked, as in PEP 484.

A check costs 50 to 200 µs, and loops call some functions 100 000 times in a test: of the calls of a function in one
test the first 20 are checked, then every hundredth. All others go past jaxtyping, which binds arguments even of calls
that nobody checks.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections import Counter
from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

FIRST, PERIOD = 20, 100  # calls of a function in one test

_jaxtyped = jaxtyping.jaxtyped
_typechecker = functools.partial(beartype, conf=BeartypeConf(is_pep484_tower=True))
_counts: Counter[Callable[..., Any]] = Counter()


def install(package: str) -> None:
    """Check what is called in modules of the package that are imported from now on."""
    jaxtyping.jaxtyped = _decorate  # what the hook writes above every function and class
    jaxtyping.install_import_hook(package, None)


def restart() -> None:
    """Count the calls of every function from zero: a test begins."""
    _counts.clear()


def _decorate(*, typechecker: object) -> Callable[..., Any]:
    del typechecker  # the hook's: none
    return check_some


def check_some(item: Any) -> Any:
    """Return the function or data class, checked at its first calls in a test and then at a few."""
    if inspect.isclass(item):
        if dataclasses.is_dataclass(item) and "__init__" in vars(item):
            item.__init__ = check_some(item.__init__)  # type: ignore[misc]
        return item
    if "<locals>" in item.__qualname__:
        return item  # it is made anew at every call of what encloses it, and so would its checks be
    if item.__annotations__.get("return") == "Self":
        return item  # beartype knows Self only if it decorates the class

    check = functools.cache(lambda: _jaxtyped(item, typechecker=_typechecker))  # made at the first call, if any

    @functools.wraps(item)
    def call(*args: Any, **kwargs: Any) -> Any:
        number = _counts[item]
        _counts[item] = number + 1
        if number >= FIRST and number % PERIOD:
            return item(*args, **kwargs)
        return check()(*args, **kwargs)

    return call
