"""Whose code something is: a library's, which is known by its name, or a user's, which is read."""

from __future__ import annotations

import sys
import sysconfig
from types import ModuleType
from typing import Any

OURS = "paretoik"
INSTALLED = ("/site-packages/", "/dist-packages/")
PYTHON = (sysconfig.get_path("stdlib"), "<frozen ")


def is_library(module: str | None, file: str | None = None) -> bool:
    """Return whether a module is ours, Python's, or installed; ``file`` is its code's where that is at hand."""
    name = module or ""
    if name.partition(".")[0] in {OURS, "builtins", *sys.stdlib_module_names}:
        return True
    place = file or getattr(sys.modules.get(name), "__file__", None)
    if place is None:
        return False
    return place.startswith(PYTHON) or any(folder in place.replace("\\", "/") for folder in INSTALLED)


def is_library_class(kind: type) -> bool:
    """Return whether a class is a library's."""
    return is_library(kind.__module__)


def is_library_module(module: ModuleType) -> bool:
    """Return whether a module is a library's."""
    return is_library(module.__name__, getattr(module, "__file__", None))


def library_name(value: Any) -> str:
    """Return the name of a library's function or class: wherever within the library it is defined."""
    package = str(getattr(value, "__module__", None) or "").partition(".")[0]
    return f"{package}:{getattr(value, '__qualname__', type(value).__qualname__)}"
