"""How users call: a name that no argument has, one too many or one too few, is refused in one line.

Python's own TypeError says less, and a name spelt almost right is told the right one.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from paretoik.errors import InvalidInput
from paretoik.inputs import likely_spelling, listed, shown

Callee = TypeVar("Callee", bound=Callable[..., Any])


def check_call(callee: Callee) -> Callee:
    """Let a function, or the constructor and the public methods of a class, refuse calls that do not fit its signature.

    What is called raises InvalidInput then, before anything is done; a call that fits costs nothing more.
    """
    if not inspect.isclass(callee):
        return _checked(callee)  # type: ignore[return-value]
    for name, member in list(vars(callee).items()):
        if name != "__init__" and name.startswith("_"):
            continue
        if isinstance(member, classmethod | staticmethod):
            setattr(callee, name, type(member)(_checked(member.__func__)))
        elif inspect.isfunction(member):
            setattr(callee, name, _checked(member))
    return callee


def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except TypeError:
            fault = _fault(function, arguments, named)
            if not fault:  # it is the function's own
                raise
        raise InvalidInput(f"{function.__qualname__.removesuffix('.__init__')}: {fault}")

    return call


def _fault(function: Callable[..., Any], arguments: tuple[Any, ...], named: Mapping[str, Any]) -> str:
    """Return what does not fit a signature, "" where all of it does."""
    signature = inspect.signature(function)
    parameters = signature.parameters.values()
    try:
        signature.bind(*arguments, **named)
    except TypeError:
        pass
    else:
        return ""
    names = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    names = [name for name in names if name not in ("self", "cls")]
    if not any(each.kind is each.VAR_KEYWORD for each in parameters):
        for name in named.keys() - set(names):
            return f"{_wish(names)} wanted, got {shown(name)}{likely_spelling(name, names)}"
    positional = [each for each in parameters if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
    own = sum(each.name in ("self", "cls") for each in positional[:1])
    if len(arguments) > len(positional) and not any(each.kind is each.VAR_POSITIONAL for each in parameters):
        wish = f"no more than {len(positional) - own} by place" if len(positional) > own else "arguments by name"
        return f"{wish} wanted, got {len(arguments) - own} by place"
    for each in positional[: len(arguments)]:
        if each.name in named:
            return f"{each.name} wanted once, got it by place and by name"
    missing = [
        each.name
        for each in parameters
        if each.default is each.empty
        and each not in positional[: len(arguments)]
        and each.name not in named
        and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    ]
    return f"{listed(missing)} wanted, got none"


def _wish(names: Iterable[str]) -> str:
    every = list(names)
    return f"arguments among {listed(every)}" if every else "no arguments"
