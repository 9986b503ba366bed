"""What a class and an object of it are made of."""

from __future__ import annotations

import copyreg
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cached_property
from types import FunctionType, GetSetDescriptorType, MemberDescriptorType
from typing import Any

from paretoik.fingerprint.functions import underlying
from paretoik.fingerprint.libraries import OURS, is_library, is_library_class, library_name
from paretoik.fingerprint.syntax import Function, first_argument, syntax_of, used_methods, written_places

CONSTRUCTION = ("__init__", "__post_init__", "__new__", "__init_subclass__")
EVALUATING = frozenset(  # what a search calls of a problem
    {"_evaluate", "evaluate", "__call__", "decode", "encode", "explain", "species", "sample_starts", "algorithm"}
    | {"_calc_pareto_front", "_calc_pareto_set"}
)
PYMOO = "pymoo.core.problem"
EVALUATION = frozenset(  # how a pymoo problem is evaluated, not what it is
    {"elementwise_func", "elementwise_runner", "requires_kwargs", "strict"}
    | {"exclude_from_serialization", "callback", "cache"}
)


def class_parts(kind: type) -> dict[str, object]:
    """Return what a class is: a library's its name, a user's what it is made from, its methods and its attributes."""
    if is_library_class(kind):
        return {"name": library_name(kind)}
    parts: dict[str, object] = {"name": kind.__name__, "bases": [base for base in kind.__bases__ if base is not object]}
    if is_dataclass(kind):
        for each in fields(kind):
            default = each.default_factory if each.default is MISSING else each.default
            parts[f"field {each.name}"] = None if default is MISSING else default
    state = _state_names(kind)
    if issubclass(kind, Enum):
        parts["members"] = {name: member.value for name, member in kind.__members__.items()}
        state |= {name for name in vars(kind) if name in kind.__members__ or name[0] == name[-1] == "_"}
    for name, value in vars(kind).items():
        slot = isinstance(value, MemberDescriptorType | GetSetDescriptorType)
        if not slot and name not in state and (_is_written(value) if name.startswith("__") else name != "_abc_impl"):
            parts[f"attribute {name}"] = value
    return parts


def _is_written(value: object) -> bool:
    """Return whether what has a special name is a function that a user wrote, not one that was generated."""
    function = underlying(value)
    return (
        function is not None
        and not is_library(function.__module__, function.__code__.co_filename)
        and (not function.__code__.co_filename.startswith("<string>"))
    )


def object_state(value: Any) -> Mapping[str, object]:
    """Return by name what makes an object what it is, without what was computed from it meanwhile.

    Of data classes these are the fields; of a user's objects, of ours and of pymoo's problems the attributes, except
    those that its evaluation writes; of those of libraries what they would be pickled with.
    """
    kind = type(value)
    if is_dataclass(kind):
        return {each.name: getattr(value, each.name) for each in fields(kind) if hasattr(value, each.name)}
    is_problem = any(base.__module__ == PYMOO for base in kind.__mro__)
    if is_library_class(kind) and kind.__module__.partition(".")[0] != OURS and not is_problem:
        return _reduced(value)
    hidden = {name for base in kind.__mro__ for name, item in vars(base).items() if isinstance(item, cached_property)}
    hidden |= _state_names(kind) | set(getattr(kind, "search_attributes", ()))
    hidden |= EVALUATION if is_problem else set()
    names = [*getattr(value, "__dict__", ()), *copyreg._slotnames(kind)]  # type: ignore[attr-defined]  # as pickle has it
    return {name: getattr(value, name) for name in names if name not in hidden and hasattr(value, name)}


def _reduced(value: Any) -> Mapping[str, object]:
    try:
        reduced = value.__reduce_ex__(4)
    except Exception:  # a lock, a file, a pool: nothing that defines a problem
        return {}
    if isinstance(reduced, str):
        return {"name": reduced}
    function, arguments, state, *items = (*reduced, None, None, None)[:5]
    parts = {"arguments": [each for each in arguments if each is not type(value)], "state": state}
    parts["function"] = None if getattr(function, "__module__", "") == "copyreg" else function
    return parts | {f"items {k}": None if each is None else list(each) for k, each in enumerate(items)}


def _state_names(kind: type) -> set[str]:
    """Return the attributes that methods of a user's class write once it is constructed: counts, caches, progress.

    Of a class that can be evaluated these are the methods that an evaluation leads to, of others all.
    """
    nodes = dict[str, Function]()
    for base in reversed(kind.__mro__):
        if not is_library_class(base):
            nodes |= _methods(base)
    evaluates = any(name in nodes for name in ("_evaluate", "__call__"))
    late = _reachable(nodes, EVALUATING) if evaluates else set(nodes)  # a setter is a user's to call, and defines
    names = {base.__name__ for base in kind.__mro__}
    return {
        attribute
        for name in late - _reachable(nodes, CONSTRUCTION)
        for owner, attribute in written_places(nodes[name])
        if attribute is not None and owner in {first_argument(nodes[name]), *names}
    }


def _reachable(nodes: Mapping[str, Function], names: Iterable[str]) -> set[str]:
    """Return which methods some of them lead to, these included."""
    reached, pending = set[str](), [name for name in names if name in nodes]
    while pending:
        name = pending.pop()
        reached.add(name)
        pending += used_methods(nodes[name]) & nodes.keys() - reached
    return reached


def _methods(kind: type) -> dict[str, Function]:
    """Return the syntax of a class's own methods by name."""
    nodes = dict[str, Function]()
    for name, value in vars(kind).items():
        accessor = value.fget if isinstance(value, property) else getattr(value, "func", value)
        function = underlying(accessor)
        if isinstance(function, FunctionType):
            node = syntax_of(function.__code__, function.__globals__)
            if node is not None:
                nodes[name] = node
    return nodes
