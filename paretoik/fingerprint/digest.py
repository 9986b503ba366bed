"""Digests of values: equal for equal ones, in all processes and versions of Python."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from hashlib import blake2b
from pathlib import PurePath
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from paretoik.fingerprint.classes import class_parts, object_state
from paretoik.fingerprint.functions import function_parts, underlying
from paretoik.fingerprint.libraries import is_library_class, library_name


@dataclass(frozen=True, kw_only=True)
class DigestOptions:
    """How far values are looked into, and how numbers are compared."""

    depth: int = 100  # of values within each other; what lies deeper counts by its type, or Python's stack would end
    decimals: int = 6  # of computed values [rad, m, shares]: processors differ in the last bits of what they compute


OPTIONS = DigestOptions()
EXACT = 2**53  # up to which floats hold all integers
GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)


@dataclass(kw_only=True, eq=False)
class Digester:
    """Digests of values that may refer to each other, each computed once; ``rounded`` while they are computed ones."""

    done: dict[tuple[int, bool], tuple[object, bytes]] = field(default_factory=dict)  # values too, so that they live
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
        """Round the numbers of what is digested meanwhile."""
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
                return joined("path", value.name.encode(errors="surrogatepass"))  # wherever it is
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
        function = underlying(value) if is_library_class(type(value)) else None  # a user's may hold more
        if function is not None:
            return self._function(function)
        if isinstance(value, BuiltinFunctionType | np.ufunc):
            return joined("function", library_name(value).encode())
        return self._object(value)

    def _own_class(self, value: object) -> list[bytes]:
        """Return the digest of a collection's class where a user wrote it."""
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
        """Return the bytes of numbers, the same for all types, and for both zeros and all NaNs."""
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
    """Return the digest of parts under a label; where one ends and the next begins counts."""
    digest = blake2b(label.encode(errors="surrogatepass") + b"\0", digest_size=32)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.digest()
