"""Modules of a user, written into files and loaded, unchanged or changed."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

PREFIX = "users_code_"
NUMBERS = itertools.count()


def loader(folder: Path) -> Callable[[str], ModuleType]:
    """Return a function that loads a source from its own file, under its own name."""

    def load(source: str) -> ModuleType:
        name = f"{PREFIX}{next(NUMBERS)}"
        file = folder / f"{name}.py"
        file.write_text(source)
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        return module

    return load
