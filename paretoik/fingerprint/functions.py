"""What a function is made of: its code, and the values that it finds outside."""

from __future__ import annotations

import dis
import inspect
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from types import CodeType, FunctionType, ModuleType
from typing import Any

from paretoik.fingerprint.libraries import is_library, is_library_module, library_name
from paretoik.fingerprint.syntax import (
    Function,
    Place,
    nested_codes,
    normalise,
    read_names,
    syntax_of,
    written_places,
)

LOADS = {dis.opmap["LOAD_GLOBAL"]: 1, dis.opmap["LOAD_NAME"]: 0}  # by how many bits their arguments are shifted


@dataclass(frozen=True, kw_only=True, eq=False)
class FunctionParts:
    """A function's ``code`` as text, and by name the ``values`` that it is made with or finds where it runs.

    ``node`` is its syntax, where the source is at hand and the code is not a library's.
    """

    code: str
    values: dict[str, object]
    node: Function | None


def function_parts(function: FunctionType) -> FunctionParts:
    """Return the parts of a function; what it changes itself, such as a cache of its own, is none of them."""
    code, module_globals = function.__code__, function.__globals__
    if is_library(function.__module__, code.co_filename):
        bare = inspect.unwrap(function)  # type checks that a user has put around it do not count
        return FunctionParts(code=library_name(bare), values=_closure(bare, set()), node=None)
    node = syntax_of(code, module_globals)
    written = set[Place]() if node is None else written_places(node)
    names = {name for name, _ in written}
    values = _closure(function, names) | _defaults(function, names)
    values |= {
        f"attribute {name}": value
        for name, value in vars(function).items()
        if name != "__wrapped__" and (function.__name__, name) not in written
    }
    loaded = set(_loaded(code)) if node is None else set(_loaded(code)) & read_names(node)
    for name in loaded & module_globals.keys() - names:
        values |= _reached(f"global {name}", module_globals[name], code)
    return FunctionParts(code=_bytecode(code) if node is None else normalise(node), values=values, node=node)


def _closure(function: FunctionType, written: set[str]) -> dict[str, object]:
    values = dict[str, object]()
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        if name not in written:
            try:
                values[f"closure {name}"] = cell.cell_contents
            except ValueError:  # it has none yet
                values[f"closure {name}"] = "empty"
    return values


def _defaults(function: FunctionType, written: set[str]) -> dict[str, object]:
    positional = function.__code__.co_varnames[: function.__code__.co_argcount]
    defaults = function.__defaults__ or ()
    named = dict(zip(positional[len(positional) - len(defaults) :], defaults, strict=True))
    named |= function.__kwdefaults__ or {}
    return {f"default {name}": value for name, value in named.items() if name not in written}


def _loaded(code: CodeType) -> Iterator[str]:
    """Yield the names that code, and code within it, loads from its module."""
    for each in nested_codes(code):
        extended, instructions = 0, each.co_code
        for operation, argument in zip(instructions[::2], instructions[1::2], strict=True):
            index = extended << 8 | argument
            if operation in LOADS:
                yield each.co_names[index >> LOADS[operation]]
            extended = index if operation == dis.EXTENDED_ARG else 0


def _reached(label: str, value: object, code: CodeType) -> dict[str, object]:
    """Return a global value, of a user's module what code may take from it."""
    if not isinstance(value, ModuleType) or is_library_module(value):
        return {label: value}
    values = dict[str, object]()
    for name in {name for each in nested_codes(code) for name in each.co_names}:
        if name in vars(value):
            values |= _reached(f"{label}.{name}", vars(value)[name], code)
    return values


def _bytecode(code: CodeType) -> str:
    """Return code whose source is not at hand as text; every version of Python has its own."""
    constants = [_bytecode(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return f"{sys.version_info[:2]} {code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def underlying(value: Any) -> FunctionType | None:
    """Return the Python function that a value is, or was compiled or wrapped from, None for others."""
    for _ in range(100):  # a decorator may wrap another's
        if isinstance(value, FunctionType):
            return value
        value = next((getattr(value, name) for name in ("__wrapped__", "py_func") if hasattr(value, name)), None)
    return None
