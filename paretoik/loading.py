"""Opening a user's problem: 'problems/tringali_2020.py:energy_torque' → the object."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from paretoik.errors import InvalidInput


def load_problem(reference: str) -> Any:
    """Return the pymoo problem that ``file.py:name`` or ``package.module:name`` stands for.

    As with Flask and uvicorn: for a file the folders with an ``__init__.py`` above it are its package, whose root goes
    *first* on sys.path. A name that is not a problem but a function without arguments is called.

    Raises InvalidInput where the file, the module or the name is missing, loading it fails, or what it names is no
    problem.
    """
    place, separator, name = reference.rpartition(":")
    if not separator or not place or not name:
        raise InvalidInput(f"problem {reference!r}: wants FILE.py:NAME or package.module:NAME")
    found = getattr(_module(place), name, None)
    if found is None:
        raise InvalidInput(
            f"problem {reference!r}: {place} has no {name!r}; it has {', '.join(_offered(place)) or 'none'}"
        )
    problem = found() if callable(found) and not _is_problem(found) else found
    if not _is_problem(problem):
        raise InvalidInput(
            f"problem {reference!r}: wants a pymoo problem or a function that returns one, got {problem!r}"
        )
    return problem


def problems_in(place: str) -> dict[str, str]:
    """Return the problems that a module or file offers, with the first line of each one's documentation.

    A problem is a pymoo problem, or a function without required arguments that is annotated to return one.

    Raises InvalidInput as ``load_problem`` does.
    """
    module = _module(place)
    found = {name: (getattr(module, name).__doc__ or "").strip() for name in _offered(place)}
    return {name: text.splitlines()[0] if text else "" for name, text in found.items()}


def _offered(place: str) -> list[str]:
    import inspect

    module = _module(place)
    names = []
    for name, value in vars(module).items():
        own = getattr(value, "__module__", None) == module.__name__
        if name.startswith("_") or inspect.isclass(value):
            continue
        returns = getattr(value, "__annotations__", {}).get("return", "") if callable(value) else ""
        if _is_problem(value) or (own and callable(value) and str(returns) in ("Tracking", "Problem")):
            names.append(name)
    return names


def _module(place: str) -> ModuleType:
    path = Path(place)
    dotted = str(place)
    if path.suffix == ".py":
        if not path.is_file():
            raise InvalidInput(f"problem file {place}: not found in {Path.cwd()}")
        root, dotted = _root_and_name(path.resolve())
        _refuse_clash(root, dotted)
        sys.path[:] = [str(root), *(entry for entry in sys.path if entry != str(root))]
    try:
        return importlib.import_module(dotted)
    except ModuleNotFoundError as error:
        if error.name == dotted or dotted.startswith(f"{error.name}."):
            raise InvalidInput(f"module {dotted!r}: not found; wants FILE.py or an importable module") from error
        raise InvalidInput(f"problem file {place}: needs the module {error.name!r}, which is not installed") from error
    except InvalidInput:
        raise
    except Exception as error:
        raise InvalidInput(f"problem file {place}: loading it failed: {type(error).__name__}: {error}") from error


def _root_and_name(path: Path) -> tuple[Path, str]:
    parts, folder = [path.stem], path.parent
    while (folder / "__init__.py").is_file():
        parts.append(folder.name)
        folder = folder.parent
    return folder, ".".join(reversed(parts))


def _refuse_clash(root: Path, dotted: str) -> None:
    package = dotted.partition(".")[0]
    loaded = sys.modules.get(package)
    file = getattr(loaded, "__file__", None)
    if loaded is not None and file is not None and not Path(file).resolve().is_relative_to(root):
        raise InvalidInput(f"package {package!r} is already imported from {file}; wants the one in {root}")


def _is_problem(value: object) -> bool:
    return all(hasattr(value, name) for name in ("n_var", "n_obj", "evaluate"))
