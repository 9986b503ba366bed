"""Loads a user's problem from its name, such as 'problems/tringali_2020.py:energy_torque'."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from paretoik.errors import InvalidInput, ParetoikError
from paretoik.file_paths import missing_file, shell_command
from paretoik.inputs import attribute_of, cause_of, is_integer, likely_spelling, limited_call, listed, shown


def load_problem(reference: str) -> Any:
    """Return the problem of ``file.py:name`` or ``package.module:name``.

    A problem is a pymoo problem or a closed loop. The folders above a file that have an ``__init__.py`` are its
    packages. The folder of the outermost package, or the current folder for a module, comes *last* on sys.path, so that
    its files replace no module of Python or of a library.

    The name may also be a function that the file defines, a function annotated to return a problem, or a problem class:
    it is called without arguments. Nothing else is called. Errors of paretoik pass unchanged.

    Raises InvalidInput if file, module or name is missing, if loading fails, or if the name is not a problem.
    """
    place, _, name = reference.rpartition(":")
    if not place or not name:
        file = [Path(reference)] if str(reference).endswith(".py") else []
        raise InvalidInput(
            f"problem must be FILE.py:NAME or package.module:NAME, got {shown(reference)} "
            f"({shell_command('paretoik', 'list', *file)} shows names)"
        )
    module = _import_module(place)
    value = attribute_of(module, name)
    if value is None:
        offered, others = _offers(module)
        names = [listed(offered)] if offered else []
        names += [f"perhaps {listed(others)} (no return annotation)"] if others else []
        wish = f"one of {place}'s: {', '.join(names)}" if names else f"a problem or function in {place}, which has none"
        hint = likely_spelling(name, [*offered, *others])
        raise InvalidInput(f"problem {reference!r} must be {wish}, got {shown(name)}{hint}")
    problem = value
    function = _function_of(value)
    is_factory = function is not None and (function.__module__ == module.__name__ or _returns_problem(function))
    if hasattr(value, "evaluate") if inspect.isclass(value) else is_factory:  # a class of problems, or a function
        if required := _required_arguments(value):
            raise InvalidInput(
                f"problem {reference!r} must be a function without arguments, got one that needs {', '.join(required)}"
            )
        try:
            with limited_call(f"problem {reference!r}", loads=True):
                problem = value()
        except (ParetoikError, KeyboardInterrupt):
            raise
        except BaseException as error:  # a user's function may raise anything
            summary = _summary(error, getattr(module, "__file__", None))
            raise InvalidInput(f"problem {reference!r} cannot be built: {summary}") from error
    if not _is_problem(problem):
        imported = function is not None and problem is value
        hint = "; a function from another module must be annotated, such as def f() -> pk.Tracking" * imported
        raise InvalidInput(
            f"problem {reference!r} must be a pymoo problem or a function that returns one, got {shown(problem)}{hint}"
        )
    return problem


def load_value(what: str, reference: str) -> Any:
    """Return the value of ``file.py:name`` or ``package.module:name``; nothing is called.

    Raises InvalidInput if the value is missing or loading fails; the message begins with ``what``.
    """
    place, _, name = reference.rpartition(":")
    module = _import_module(place, what)
    if not hasattr(module, name):
        names = [each for each in vars(module) if not each.startswith("_")]
        raise InvalidInput(
            f"{what} {reference!r} must be a name in {place}, got {shown(name)}{likely_spelling(name, names)}"
        )
    return getattr(module, name)


def problems_in(place: str) -> tuple[dict[str, str], list[str]]:
    """Return a module's problems, with the first line of their documentation, and names of possible problems.

    A problem is a pymoo problem, or a function without required arguments that is annotated to return one. A possible
    problem is a function without required arguments and without annotation. Raises InvalidInput if the module cannot be
    loaded.
    """
    offered, silent = _offers(_import_module(place))
    return {name: (inspect.getdoc(value) or "").partition("\n")[0] for name, value in offered.items()}, silent


def _import_module(place: str, what: str = "problem") -> ModuleType:
    path = Path(place)
    root, dotted = Path.cwd(), place
    if path.suffix == ".py":
        if not path.is_file():
            raise InvalidInput(f"{what} file {place} must be a file, got {missing_file(path)}")
        parts, root = [path.stem], path.resolve().parent
        while (root / "__init__.py").is_file():
            parts, root = [root.name, *parts], root.parent
        dotted = ".".join(parts)
    elif not all(part.isidentifier() for part in dotted.split(".")):
        raise InvalidInput(f"{what} file must be FILE.py or package.module, got {shown(place)}")
    if str(root) not in sys.path:
        sys.path.append(str(root))
    importlib.invalidate_caches()
    try:
        with limited_call(f"{what} file {place}", loads=True):
            if path.suffix == ".py":
                _import_package(root, dotted.partition(".")[0])
            return importlib.import_module(dotted)
    except (ParetoikError, KeyboardInterrupt):
        raise
    except ModuleNotFoundError as error:
        missing = str(error.name)
        if dotted == missing or dotted.startswith(f"{missing}."):
            hint = likely_spelling(missing, [file.stem for file in root.glob("*.py")])
            raise InvalidInput(
                f"module {shown(dotted)} must be FILE.py or an importable module, got no module {shown(missing)}{hint}"
            ) from error
        raise InvalidInput(f"{what} file {place} cannot be loaded: module {missing!r} is not installed") from error
    except BaseException as error:  # a user's file may raise anything
        file = str(path.resolve()) if path.suffix == ".py" else None
        raise InvalidInput(f"{what} file {place} cannot be loaded: {_summary(error, file)}") from error


def _import_package(root: Path, name: str) -> None:
    """Import a module or package from a folder by its name. Others on sys.path with that name are ignored."""
    folder, file = root / name, root / f"{name}.py"
    source, places = (folder / "__init__.py", [str(folder)]) if (folder / "__init__.py").is_file() else (file, None)
    if name in sys.stdlib_module_names:
        raise InvalidInput(f"{source} must not have the name of a Python module, got {name!r}; rename it")
    if name in sys.modules:
        imported = getattr(sys.modules[name], "__file__", None)
        if imported is None or Path(imported).resolve() != source:
            raise InvalidInput(
                f"package {name!r} in {root} must have a unique name, got one already imported from "
                f"{imported or 'elsewhere'}; rename yours"
            )
        return
    spec = importlib.util.spec_from_file_location(name, source, submodule_search_locations=places)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise


def _offers(module: ModuleType) -> tuple[dict[str, Any], list[str]]:
    """Return a module's problems by name, and names of possible problems, as ``problems_in`` does."""
    offered, silent = dict[str, Any](), list[str]()
    for name, value in vars(module).items():
        if name.startswith("_"):
            continue
        function = _function_of(value)
        is_factory = function is not None and function.__module__ == module.__name__ and not _required_arguments(value)
        if _is_problem(value) or (is_factory and _returns_problem(value)):
            offered[name] = value
        elif is_factory and "return" not in getattr(function, "__annotations__", {}):
            silent.append(name)
    return offered, silent


def _function_of(value: object) -> Callable[..., Any] | None:
    """Return the function that a value is or wraps, or None."""
    if not callable(value):
        return None
    try:
        function = inspect.unwrap(value)
    except BaseException:  # a user's object may raise any error, or wrap others without end
        return None
    return function if inspect.isfunction(function) else None


def _returns_problem(value: Callable[..., Any]) -> bool:
    try:
        returned = inspect.signature(value, eval_str=True).return_annotation
    except Exception:  # only a type checker can evaluate this annotation
        return False
    return inspect.isclass(returned) and hasattr(returned, "evaluate")


def _required_arguments(function: Any) -> list[str]:
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # compiled functions may have no signature
        return []
    optional = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return [p.name for p in parameters if p.default is p.empty and p.kind not in optional]


def _is_problem(value: object) -> bool:
    is_one = not inspect.isclass(value) and attribute_of(value, "evaluate") is not None
    return is_one and all(is_integer(attribute_of(value, name)) for name in ("n_var", "n_obj"))


def _summary(error: BaseException, file: str | None) -> str:
    """Return an error in one line, with the number of the last line of ``file`` in its traceback."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    where = f" in line {lines[-1]}" if lines else ""
    return cause_of(error, where)
