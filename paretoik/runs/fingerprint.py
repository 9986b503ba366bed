"""The fingerprint of a problem: it identifies the problem of a run.

It is a digest of all fields of the problem, and of the source of the user's functions and classes in them.
"""

from __future__ import annotations

import ast
import copyreg
import random
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cached_property
from hashlib import blake2b
from pathlib import PurePath
from types import BuiltinFunctionType, GetSetDescriptorType, MemberDescriptorType, MethodType, ModuleType
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.runs.user_code import (
    OURS,
    Function,
    function_parts,
    is_library,
    library_name,
    syntax_of,
    underlying,
    written_places,
)

SCHEME = "4"  # version of the digests; it changes when digests are made in another way


def fingerprint(problem: object) -> str:
    """Return a problem's digest, "SCHEME:DIGEST".

    The digest has everything that determines a problem's objectives from its genes: arm, paths, limits, obstacles, and
    functions with their source, defaults, and values of closures and globals. A user's own problem also counts by its
    class. Source counts without comments, layout, annotations and documentation. If the source is missing, or is not
    the code that runs, the bytecode and Python's version count instead. Installed libraries count by name. Values that
    problem and functions change during an evaluation, such as counts and caches, do not count, and neither does the
    place of a file.

    Two class attributes change this: ``computed_attributes`` follow from other attributes and are compared to 6
    decimals, as processors differ in the last bits; ``search_attributes`` describe the search for solutions and do not
    count. If refinement added samples to a problem, its fingerprint is that of ``finer_than``, the user's problem.
    """
    given = getattr(problem, "finer_than", None)
    return f"{SCHEME}:{Digester().digest(problem if given is None else given).hex()}"


def check_fingerprint(problem: object, stored: object, *, wish: str) -> None:
    """Raise InvalidInput, which begins with ``wish``, unless a problem has the stored fingerprint.

    A fingerprint of another scheme comes from another version of paretoik and cannot be compared.
    """
    if not isinstance(stored, str) or not stored.startswith(f"{SCHEME}:"):
        raise InvalidInput(
            f"{wish}, got a run of another version of paretoik, whose fingerprints cannot be compared: it may or "
            "may not be of this problem"
        )
    if fingerprint(problem) != stored:
        raise InvalidInput(f"{wish}, got one with another fingerprint")


# Digests of values: equal for equal values, in all processes.


@dataclass(frozen=True, kw_only=True)
class DigestOptions:
    """Bounds of values that count by their bits.

    decimals: decimals of computed values [rad, m, shares], as processors differ in the last bits
    exact: integer up to which floats represent all integers
    depth: largest depth of nested values, since Python's stack is limited; deeper ones count by type only
    """

    decimals: int = 6
    exact: int = 2**53
    depth: int = 100


OPTIONS = DigestOptions()


def joined(label: str, *parts: bytes) -> bytes:
    """Return the digest of parts under a label; the boundaries between parts count."""
    digest = blake2b(label.encode(errors="surrogatepass") + b"\0", digest_size=32)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.digest()


@dataclass(kw_only=True, eq=False)
class Digester:
    """Digests of values that may refer to each other, each computed once.

    rounded: whether the values are computed ones, which are rounded
    done: digests by the ids of values, with the values to keep these alive
    open: depths of the values whose digests are under way
    """

    rounded: bool = False
    done: dict[int, tuple[object, bytes]] = field(default_factory=dict)
    open: dict[int, int] = field(default_factory=dict)

    def digest(self, value: object) -> bytes:
        """Return the digest of a value."""
        if isinstance(value, int | float | np.number) and not isinstance(value, Enum):
            is_large = isinstance(value, int | np.integer) and abs(int(value)) >= OPTIONS.exact
            return joined("integer", str(value).encode()) if is_large else self._array(np.asarray(value))
        if value is None or isinstance(value, str | bytes | complex):
            return joined(type(value).__name__, repr(value).encode())
        if id(value) in self.done:
            return self.done[id(value)][1]
        if id(value) in self.open:
            return joined("cycle", str(len(self.open) - self.open[id(value)]).encode())
        if len(self.open) > OPTIONS.depth:
            return joined("deep", library_name(type(value)).encode())
        self.open[id(value)] = len(self.open)
        result = self._compound(value)
        del self.open[id(value)]
        self.done[id(value)] = value, result
        return result

    def _compound(self, value: Any) -> bytes:
        kind: type = type(value)
        own = [] if is_library(kind.__module__) else [self.digest(kind)]  # a user's collection class counts
        match value:
            case Enum():
                return joined("enum", self.digest(kind), value.name.encode())
            case np.ndarray() | np.generic():
                return self._array(np.asarray(value))
            case Mapping():
                items = sorted(joined("item", *map(self.digest, item)) for item in value.items())
                return joined("mapping", *own, *items)
            case Set():
                return joined("set", *own, *sorted(map(self.digest, value)))
            case list() | tuple():
                return joined("sequence", *own, *map(self.digest, value))
            case PurePath():
                return joined("path", value.name.encode(errors="surrogatepass"))  # the path's own folder does not count
            case ModuleType():
                return joined("module", value.__name__.encode())
            case type():
                return joined("class", *self._named(class_parts(value)))
            case MethodType() | property() | staticmethod() | classmethod() | cached_property():
                names = "__func__", "__self__", "fget", "fset", "fdel", "func"
                return joined(kind.__name__, *(self.digest(getattr(value, name, None)) for name in names))
            case np.random.Generator() | np.random.RandomState() | np.random.BitGenerator() | random.Random():
                return joined("chance", library_name(kind).encode())
            case BuiltinFunctionType() | np.ufunc():
                return joined("function", library_name(value).encode())
        function = None if own else underlying(value)  # a user's object may have further state
        if function is not None:
            code, values = function_parts(function)
            return joined("function", code.encode(errors="surrogatepass"), *self._named(values))
        state, computed = object_state(value), getattr(kind, "computed_attributes", ())
        exact = self._named({name: each for name, each in state.items() if name not in computed})
        rounded = Digester(rounded=True)._named({name: each for name, each in state.items() if name in computed})
        return joined("object", self.digest(kind), *exact, *rounded)

    def _array(self, array: np.ndarray) -> bytes:
        """Return the digest of an array; equal numbers, such as 0 and −0, have equal digests."""
        shape, kind = str(array.shape).encode(), array.dtype.kind
        if kind == "O":
            return joined("items", shape, self.digest(array.tolist()))
        if kind == "f" or (kind in "biu" and array.size and np.abs(array.astype(float)).max() < OPTIONS.exact):
            numbers = array.astype("<f8").round(OPTIONS.decimals) if self.rounded else array.astype("<f8")
            return joined("numbers", shape, (numbers + 0.0).tobytes())
        return joined("items", shape, str(array.dtype).encode(), array.tobytes())

    def _named(self, values: Mapping[str, object]) -> Iterator[bytes]:
        """Yield digests of values with their names, in the order of names."""
        for name in sorted(values):
            yield joined(name, self.digest(values[name]))


# The parts of a class and of its objects.


OWNERS = ("self", "cls", "super()")  # names of an object in its own methods
CONSTRUCTION = ("__init__", "__post_init__", "__new__", "__init_subclass__")
EVALUATING = frozenset(  # methods of a problem that a search calls
    {"_evaluate", "evaluate", "__call__", "decode", "encode", "explain", "species", "sample_starts", "algorithm"}
    | {"_calc_pareto_front", "_calc_pareto_set"}
)
PYMOO = "pymoo.core.problem"
EVALUATION = frozenset(  # attributes that control how pymoo evaluates a problem; they do not define it
    {"elementwise_func", "elementwise_runner", "requires_kwargs", "strict"}
    | {"exclude_from_serialization", "callback", "cache"}
)


def class_parts(kind: type) -> dict[str, object]:
    """Return the parts of a class: a library's name; a user's fields, bases, methods and attributes."""
    if is_library(kind.__module__):
        return {"name": library_name(kind)}
    parts: dict[str, object] = {"name": kind.__name__, "bases": [base for base in kind.__bases__ if base is not object]}
    if is_dataclass(kind):
        for each in fields(kind):
            default = each.default_factory if each.default is MISSING else each.default
            parts[f"field {each.name}"] = None if default is MISSING else default
    if issubclass(kind, Enum):
        return parts | {"members": {name: member.value for name, member in kind.__members__.items()}}
    hidden = _state_names(kind) | {"_abc_impl"}
    for name, value in vars(kind).items():
        function = underlying(value)
        file = "" if function is None else function.__code__.co_filename
        is_written = (
            function is not None and not is_library(function.__module__, file) and not file.startswith("<string>")
        )
        slot = isinstance(value, MemberDescriptorType | GetSetDescriptorType)
        if not slot and name not in hidden and (not name.startswith("__") or is_written):
            parts[f"attribute {name}"] = value
    return parts


def object_state(value: Any) -> Mapping[str, object]:
    """Return the attributes that define an object, by name, without values that are computed from them.

    - data classes: fields; ``metadata={"fingerprint": ...}`` says "never", or "if given": unless it is None
    - users' and paretoik's objects, pymoo problems: attributes, except those that an evaluation writes
    - other libraries' objects: the parts that pickle takes
    """
    kind = type(value)
    if is_dataclass(kind):
        counts = {each.name: each.metadata.get("fingerprint", "always") for each in fields(kind)}
        state = {name: getattr(value, name) for name in counts if counts[name] != "never" and hasattr(value, name)}
        return {name: part for name, part in state.items() if counts[name] == "always" or part is not None}
    is_problem = any(base.__module__ == PYMOO for base in kind.__mro__)
    if is_library(kind.__module__) and kind.__module__.partition(".")[0] != OURS and not is_problem:
        try:
            reduced = value.__reduce_ex__(4)
        except Exception:  # a lock, a file, a pool: these do not define a problem
            return {}
        parts = [reduced] if isinstance(reduced, str) else reduced
        return {str(k): list(each) if isinstance(each, Iterator) else each for k, each in enumerate(parts)}
    hidden = {name for base in kind.__mro__ for name, item in vars(base).items() if isinstance(item, cached_property)}
    hidden |= _state_names(kind) | set(getattr(kind, "search_attributes", ()))
    hidden |= EVALUATION if is_problem else set()
    names = [*getattr(value, "__dict__", ()), *copyreg._slotnames(kind)]  # type: ignore[attr-defined]  # as pickle has it
    return {name: getattr(value, name) for name in names if name not in hidden and hasattr(value, name)}


def _state_names(kind: type) -> set[str]:
    """Return attributes that a user's methods write after construction: counts, caches and progress.

    If the class can be evaluated, only methods called by an evaluation count, otherwise all methods.
    """
    nodes = dict[str, Function]()
    for base in reversed(kind.__mro__):
        for name, value in vars(base).items() if not is_library(base.__module__) else ():
            function = underlying(value.fget if isinstance(value, property) else getattr(value, "func", value))
            node = None if function is None else syntax_of(function)
            if node is not None:
                nodes[name] = node
    evaluates = "_evaluate" in nodes or "__call__" in nodes
    late = _reachable(nodes, EVALUATING) if evaluates else set(nodes)  # users call setters, so these define the problem
    classes = {base.__name__ for base in kind.__mro__}
    return {
        attribute
        for name in late - _reachable(nodes, CONSTRUCTION)
        for owner, attribute in written_places(nodes[name])
        if attribute is not None and owner in {*OWNERS, *classes}
    }


def _reachable(nodes: Mapping[str, Function], names: Iterable[str]) -> set[str]:
    """Return these methods and those that they call on self, cls or ``super()``."""
    reached, pending = set[str](), [name for name in names if name in nodes]
    while pending:
        name = pending.pop()
        reached.add(name)
        used = [each for each in ast.walk(nodes[name]) if isinstance(each, ast.Attribute)]
        pending += {each.attr for each in used if ast.unparse(each.value) in OWNERS} & nodes.keys() - reached
    return reached
