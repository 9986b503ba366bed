"""The fingerprint of a problem: a run recognises its problem by it."""

from __future__ import annotations

import copyreg
import random
from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cached_property
from hashlib import blake2b
from pathlib import PurePath
from types import BuiltinFunctionType, FunctionType, GetSetDescriptorType, MemberDescriptorType, MethodType, ModuleType
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.runs.user_code import (
    OURS,
    Function,
    first_argument,
    function_parts,
    is_library,
    is_library_class,
    library_name,
    syntax_of,
    underlying,
    used_methods,
    written_places,
)

# The parts of a class and of its objects that count.


CONSTRUCTION = ("__init__", "__post_init__", "__new__", "__init_subclass__")
EVALUATING = frozenset(  # methods of a problem that a search calls
    {"_evaluate", "evaluate", "__call__", "decode", "encode", "explain", "species", "sample_starts", "algorithm"}
    | {"_calc_pareto_front", "_calc_pareto_set"}
)
PYMOO = "pymoo.core.problem"
EVALUATION = frozenset(  # attributes for how a pymoo problem is evaluated, which do not define it
    {"elementwise_func", "elementwise_runner", "requires_kwargs", "strict"}
    | {"exclude_from_serialization", "callback", "cache"}
)


def class_parts(kind: type) -> dict[str, object]:
    """Return the parts of a class: the name of a library's; fields, bases, methods and attributes of a user's."""
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
    """Return whether a special name belongs to a function that a user wrote, not to a generated one."""
    function = underlying(value)
    return (
        function is not None
        and not is_library(function.__module__, function.__code__.co_filename)
        and (not function.__code__.co_filename.startswith("<string>"))
    )


def object_state(value: Any) -> Mapping[str, object]:
    """Return by name what defines an object, without what was computed from it meanwhile.

    Data classes count by their fields; objects of users, ours and pymoo's problems by their attributes, except those
    that an evaluation writes; objects of libraries by what pickle would take.
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
    """Return the attributes that methods of a user's class write after construction: counts, caches, progress.

    If the class can be evaluated, only methods that an evaluation leads to count, else all methods.
    """
    nodes = dict[str, Function]()
    for base in reversed(kind.__mro__):
        if not is_library_class(base):
            nodes |= _methods(base)
    evaluates = any(name in nodes for name in ("_evaluate", "__call__"))
    late = _reachable(nodes, EVALUATING) if evaluates else set(nodes)  # a setter is called by users, so it defines
    names = {base.__name__ for base in kind.__mro__}
    return {
        attribute
        for name in late - _reachable(nodes, CONSTRUCTION)
        for owner, attribute in written_places(nodes[name])
        if attribute is not None and owner in {first_argument(nodes[name]), *names}
    }


def _reachable(nodes: Mapping[str, Function], names: Iterable[str]) -> set[str]:
    """Return which methods these methods lead to, with themselves."""
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


# Digests of values: equal for equal values, in all processes and versions of Python.


@dataclass(frozen=True, kw_only=True)
class DigestOptions:
    """How deep values are read, and how numbers are compared."""

    depth: int = 100  # of nested values; deeper ones count by their type only, as Python's stack is limited
    decimals: int = 6  # of computed values [rad, m, shares]: processors differ in their last bits


OPTIONS = DigestOptions()
EXACT = 2**53  # floats represent all integers up to this one
GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)


@dataclass(kw_only=True, eq=False)
class Digester:
    """Digests of values that may refer to each other, each made once; ``rounded`` while values are computed ones."""

    done: dict[tuple[int, bool], tuple[object, bytes]] = field(default_factory=dict)  # with values, to keep them alive
    open: dict[int, int] = field(default_factory=dict)
    rounded: bool = False

    def digest(self, value: object) -> bytes:
        """Return the digest of a value."""
        if value is None or isinstance(value, bool | int | float | complex | str | bytes | np.generic):
            return self._plain(value)
        key = id(value), self.rounded
        if key in self.done:
            return self.done[key][1]
        if id(value) in self.open:
            return joined("cycle", str(len(self.open) - self.open[id(value)]).encode())
        if len(self.open) > OPTIONS.depth:
            return joined("deep", library_name(type(value)).encode())
        self.open[id(value)] = len(self.open)
        try:
            result = self._compound(value)
        finally:
            del self.open[id(value)]
        self.done[key] = value, result
        return result

    @contextmanager
    def computed(self) -> Iterator[None]:
        """Round the numbers that are digested in the body."""
        before, self.rounded = self.rounded, True
        try:
            yield
        finally:
            self.rounded = before

    def _plain(self, value: Any) -> bytes:
        if isinstance(value, Enum):
            return joined("enum", self.digest(type(value)), value.name.encode())
        if isinstance(value, str):
            return joined("text", value.encode(errors="surrogatepass"))
        if isinstance(value, bytes):
            return joined("bytes", value)
        if isinstance(value, np.generic):
            return self._plain(value.item()) if not isinstance(value.item(), np.generic) else self._array(value)
        if isinstance(value, int) and abs(value) > EXACT:
            return joined("integer", str(int(value)).encode())
        if isinstance(value, bool | int | float):
            return joined("number", self._numbers(np.array(float(value))))
        return joined("other", repr(value).encode())

    def _compound(self, value: Any) -> bytes:
        match value:
            case np.ndarray():
                return self._array(value)
            case Mapping():
                items = sorted(joined("item", *map(self.digest, item)) for item in value.items())
                return joined("mapping", *self._own_class(value), *items)
            case Set():
                return joined("set", *self._own_class(value), *sorted(map(self.digest, value)))
            case list() | tuple():
                return joined("sequence", *self._own_class(value), *map(self.digest, value))
            case PurePath():
                return joined("path", value.name.encode(errors="surrogatepass"))  # its folder does not count
            case Enum():
                return joined("enum", self.digest(type(value)), value.name.encode())
            case ModuleType():
                return joined("module", value.__name__.encode())
            case MethodType():
                return joined("method", self.digest(value.__func__), self.digest(value.__self__))
            case type():
                return joined("class", *self._named(class_parts(value)))
            case property():
                return joined("property", *map(self.digest, (value.fget, value.fset, value.fdel)))
            case staticmethod() | classmethod():
                return joined(type(value).__name__, self.digest(value.__func__))
            case cached_property():
                return joined("property", self.digest(value.func))
        if isinstance(value, GENERATORS):
            return joined("chance", library_name(type(value)).encode())
        function = underlying(value) if is_library_class(type(value)) else None  # a user's object may contain more
        if function is not None:
            return self._function(function)
        if isinstance(value, BuiltinFunctionType | np.ufunc):
            return joined("function", library_name(value).encode())
        return self._object(value)

    def _own_class(self, value: object) -> list[bytes]:
        """Return the digest of a collection's class if a user wrote it."""
        return [] if is_library_class(type(value)) else [self.digest(type(value))]

    def _array(self, value: Any) -> bytes:
        array = np.asarray(value)
        if array.dtype.kind in "biuf" and not (
            array.dtype.kind in "iu" and np.any(np.abs(array.astype(float)) > EXACT)
        ):
            return joined("array", str(array.shape).encode(), self._numbers(array))
        if array.dtype.kind == "c":
            return joined("complex", str(array.shape).encode(), *map(self._numbers, (array.real, array.imag)))
        content = self.digest(array.tolist()) if array.dtype.kind == "O" else array.tobytes()
        return joined("items", str(array.shape).encode(), str(array.dtype).encode(), content)

    def _numbers(self, array: np.ndarray) -> bytes:
        """Return the bytes of numbers: the same for all number types, for both zeros and for all NaNs."""
        numbers = np.array(array.astype("<f8") + 0.0)
        numbers[np.isnan(numbers)] = np.nan
        return np.ascontiguousarray(numbers.round(OPTIONS.decimals) + 0.0 if self.rounded else numbers).tobytes()

    def _function(self, function: FunctionType) -> bytes:
        parts = function_parts(function)
        return joined("function", parts.code.encode(errors="surrogatepass"), *self._named(parts.values))

    def _object(self, value: Any) -> bytes:
        state = object_state(value)
        computed = getattr(type(value), "computed_attributes", ())
        exact = {name: each for name, each in state.items() if name not in computed}
        parts = [self.digest(type(value)), *self._named(exact)]
        with self.computed():
            parts += self._named({name: each for name, each in state.items() if name in computed})
        return joined("object", *parts)

    def _named(self, values: Mapping[str, object]) -> Iterator[bytes]:
        """Yield digests of values with their names, in the order of names."""
        for name in sorted(values):
            yield joined(name, self.digest(values[name]))


def joined(label: str, *parts: bytes) -> bytes:
    """Return the digest of parts under a label; the limits between parts count."""
    digest = blake2b(label.encode(errors="surrogatepass") + b"\0", digest_size=32)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.digest()


# The fingerprint of a problem.


SCHEME = "2"  # of digests; it changes when digests are made in another way


def fingerprint(problem: object) -> str:
    """Return a digest of everything that gives a problem's genes their objectives, "SCHEME:DIGEST".

    All attributes of the problem count, field by field: arm, paths, limits, obstacles, functions with their code, their
    defaults, and the values of their closures and globals; for a user's own problem its class too. Code counts by its
    syntax, without comments, layout, annotations and documentation; if its source is not at hand, or not what runs,
    by its bytecode and Python's version. Code of installed libraries counts by name. Values that problem and functions
    change themselves during an evaluation, such as counts and caches, do not count, nor does the place of a file.

    Two attributes of a class say more: ``computed_attributes`` follow from the others and are compared to 6 decimals,
    as processors differ in the last bits; ``search_attributes`` say how solutions are searched for, and do not count.
    A problem on more samples than the user's, ``finer_than``, has the fingerprint of the user's.
    """
    given = getattr(problem, "finer_than", None)
    return f"{SCHEME}:{Digester().digest(problem if given is None else given).hex()}"


def check_fingerprint(problem: object, stored: object, *, wish: str) -> None:
    """Raise InvalidInput, which begins with ``wish``, if a problem does not have the stored fingerprint.

    A fingerprint of another scheme comes from another version of paretoik and cannot be compared.
    """
    if not isinstance(stored, str) or not stored.startswith(f"{SCHEME}:"):
        raise InvalidInput(
            f"{wish}, got a run of another version of paretoik, whose fingerprints cannot be compared: whether it is "
            "of this problem is not known"
        )
    if fingerprint(problem) != stored:
        raise InvalidInput(f"{wish}, got one whose fingerprint is another")
