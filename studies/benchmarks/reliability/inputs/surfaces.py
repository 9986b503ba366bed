"""Every public function, constructor and method, with the kinds of values that each of its arguments takes.

Everything is read from the public names, their signatures and annotations, so that a new argument is included at once.
Left out are methods that formulations offer to the verbs (they take genes and programs, which no user has), and names
that a namespace merely imports.
"""

from __future__ import annotations

import collections.abc
import inspect
import pathlib
import re
import sys
import types
import typing
from collections.abc import Callable, Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

import paretoik

Kind = Literal[
    "number", "size", "flag", "text", "choice", "path", "array", "sequence", "mapping", "function", "instance",
    "anything", "nothing",
]  # fmt: skip
PLAIN: dict[str, Kind] = {
    "float": "number",
    "Number": "number",
    "int": "size",
    "bool": "flag",
    "str": "text",
    "None": "nothing",
    "Any": "anything",
    "object": "anything",
    "ArrayLike": "array",
}
GENERIC: dict[str, Kind] = {
    "Literal": "choice",
    "Callable": "function",
    "Mapping": "mapping",
    "Sequence": "sequence",
    "Iterable": "sequence",
    "Collection": "sequence",
    "tuple": "sequence",
}
SEAM = ("formulations", "capability", "resolution", "closed_loop", "task.task")
"""Namespaces whose methods parts of the library offer each other; their constructors are public all the same."""

OF_GENES = ("decode", "encode", "evaluate")
"""Methods of formulations that users call; the rest is for the verbs."""

RESULTS = frozenset(
    {"Arm", "AxesEllipses", "Choice", "FastestPath", "FitErrors", "PerformancePolygon", "Plan", "PolynomialEllipsoids"}
    | {"ResolvedMotion", "TimeOptimalRun"}
)
"""Classes that functions of the library make and return; the functions check their arguments."""


class Argument(NamedTuple):
    """An argument by name and the kinds of values that it takes; ``star`` says that it can come in any number.

    Users do not write its name if it ``is_unnamed``.
    """

    name: str
    kinds: frozenset[Kind]
    star: Literal["", "*", "**"] = ""
    is_required: bool = False
    is_unnamed: bool = False


class Surface(NamedTuple):
    """A callable that users call, by its public name; a method has an ``owner``."""

    name: str
    owner: type | None
    method: str
    function: Callable[..., Any]
    arguments: tuple[Argument, ...]


def surfaces() -> list[Surface]:
    """Return all public callables that take an argument, each once."""
    by_function: dict[object, Surface] = {}
    for name in sorted(dir(paretoik)):
        item = getattr(paretoik, name)
        for public, each in members(name, item) if inspect.ismodule(item) else [(name, item)]:
            found = list[Surface]()
            if inspect.isclass(each):
                is_made = each.__name__ not in RESULTS and not issubclass(each, Exception) and not _is_protocol(each)
                if is_made and each.__init__ is not object.__init__:
                    found += _surface(public, None, "", each, skip=0)
                home = each.__module__.removeprefix("paretoik.")
                if not _is_protocol(each) and (not home.startswith(SEAM) or home.startswith("formulations.")):
                    found += _methods(public, each)
            elif callable(each):
                found += _surface(public, None, "", each, skip=0)
            for surface in found:
                by_function.setdefault(inspect.unwrap(surface.function), surface)
    return list(by_function.values())


def members(name: str, module: types.ModuleType) -> Iterator[tuple[str, object]]:
    """Yield the public members of a namespace, by their public names."""
    package = module.__name__ if hasattr(module, "__path__") else module.__name__.rpartition(".")[0]
    for member in dir(module):
        item = getattr(module, member)
        home = str(getattr(item, "__module__", ""))
        is_own = home == module.__name__ or hasattr(module, "__path__") or inspect.isclass(item)
        if not member.startswith("_") and is_own and home.startswith(f"{package}."):
            yield f"{name}.{member}", item


def _methods(name: str, owner: type) -> Iterator[Surface]:
    for method, item in inspect.getmembers(owner):
        function = getattr(item, "__func__", item)
        if method.startswith("_") or not inspect.isfunction(function) or not function.__module__.startswith("paretoik"):
            continue
        has_genes = method in OF_GENES and hasattr(owner, "check_genes")
        if owner.__module__.startswith("paretoik.formulations.") and not has_genes:
            continue
        bound = isinstance(inspect.getattr_static(owner, method), types.FunctionType)
        yield from _surface(f"{name}.{method}", owner if bound else None, method, item, skip=int(bound))


def _surface(
    name: str, owner: type | None, method: str, function: Callable[..., Any], *, skip: int
) -> Iterator[Surface]:
    try:
        parameters = list(inspect.signature(function).parameters.values())[skip:]
    except ValueError:  # errors take any text
        return
    home = function if inspect.isclass(function) else inspect.unwrap(function)
    scope = vars(sys.modules[getattr(home, "__module__", type(function).__module__)])
    arguments = tuple(_argument(parameter, scope) for parameter in parameters)
    if method == "evaluate":
        arguments = arguments[:1]  # the others are pymoo's
    if arguments:
        yield Surface(name, owner, method, function, arguments)


def _argument(parameter: inspect.Parameter, scope: dict[str, Any]) -> Argument:
    stars: dict[object, Literal["*", "**"]] = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}
    star: Literal["", "*", "**"] = stars.get(parameter.kind, "")
    return Argument(
        name=parameter.name,
        kinds=frozenset(_kinds(parameter.annotation, scope) | ({"nothing"} if parameter.default is None else set())),
        star=star,
        is_unnamed=parameter.kind in (parameter.POSITIONAL_ONLY, parameter.VAR_POSITIONAL),
        is_required=parameter.default is parameter.empty and not star,
    )


def _kinds(annotation: Any, scope: dict[str, Any]) -> set[Kind]:
    """Return the kinds of values that an annotation, as it is written, allows."""
    if not isinstance(annotation, str):
        return _kinds_of(annotation, scope)
    parts = _alternatives(annotation.strip())
    kinds = set().union(*(_kind(part, scope) for part in parts))
    return kinds - {"text"} if "path" in kinds else kinds


def _kind(text: str, scope: dict[str, Any]) -> set[Kind]:
    name = re.split(r"\[", text)[0]
    if text in PLAIN:
        return {PLAIN[text]}
    if name in GENERIC:
        return {GENERIC[name]}
    return _kinds_of(scope.get(name.split(".")[0]), scope) if name != "np.ndarray" else {"array"}


def _kinds_of(item: Any, scope: dict[str, Any]) -> set[Kind]:
    """Return the kinds of an annotation that is an object: an alias, a class, a shape."""
    origin = typing.get_origin(item)
    if isinstance(item, str):
        return _kinds(item, scope)
    if origin in (typing.Union, types.UnionType):
        return set().union(*(_kinds_of(part, scope) for part in typing.get_args(item)))
    if origin is Literal:
        return {"choice"}
    if origin is collections.abc.Callable:
        return {"function"}
    if origin in (collections.abc.Sequence, tuple):
        return {"sequence"}
    if origin is collections.abc.Mapping:
        return {"mapping"}
    if item is type(None):
        return {"nothing"}
    if item is object:
        return {"anything"}
    plain = {float: "number", int: "size", bool: "flag", str: "text", np.ndarray: "array", pathlib.Path: "path"}
    if inspect.isclass(item) and item in plain:
        return {plain[item]}  # type: ignore[arg-type]
    if getattr(item, "__module__", "").startswith("jaxtyping") or hasattr(item, "array_type"):
        return {"array"}
    return {"instance"}


def _is_protocol(item: type) -> bool:
    return bool(getattr(item, "_is_protocol", False))


def _alternatives(text: str) -> list[str]:
    """Return the parts of a union, as they are written."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[(") - (letter in "])")
        if letter == "|" and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]
