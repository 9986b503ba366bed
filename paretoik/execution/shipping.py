"""What goes to workers, as bytes: objects of libraries by name, what users wrote by its content."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import Any

import cloudpickle

from paretoik.errors import InvalidInput
from paretoik.fingerprint.libraries import is_library_module
from paretoik.user_functions import cause_of


def pickled(what: str, value: Any) -> bytes:
    """Return a value as bytes that a process elsewhere can load, which need not have the user's files.

    Raises InvalidInput, naming ``what`` it is, where it cannot be sent.
    """
    try:
        with _users_modules_by_value():
            return bytes(cloudpickle.dumps(value))
    except Exception as error:  # what users wrote may raise anything
        text = f"workers: {what} that can be sent to another process wanted, got {cause_of(error)}"
        raise InvalidInput(text) from error


@contextmanager
def _users_modules_by_value() -> Iterator[None]:
    before = cloudpickle.list_registry_pickle_by_value()
    added = [module for module in _users_modules() if module.__name__ not in before]
    for module in added:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in added:
            cloudpickle.unregister_pickle_by_value(module)


def _users_modules() -> list[ModuleType]:
    """Return the modules that are no library's."""
    return [module for name, module in sys.modules.copy().items() if _is_users_module(name)]


@cache
def _is_users_module(name: str) -> bool:
    """Return whether the module of a name is a user's, as it was the first time."""
    module = sys.modules[name]
    is_named = isinstance(module, ModuleType) and getattr(module, "__name__", None) == name
    return is_named and not is_library_module(module)
