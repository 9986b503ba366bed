"""Classes of wrong values, each with the kinds of arguments for which it may have a meaning, or is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies.benchmarks.reliability.inputs.surfaces import Argument


class Raising:
    """An object that raises on every access."""

    def _raise(self, *_: object, **__: object) -> Any:
        raise RuntimeError("not from here\nnor from there")

    __array__ = __len__ = __iter__ = __bool__ = __eq__ = __float__ = __int__ = __index__ = __fspath__ = _raise
    __getitem__ = __contains__ = __lt__ = __le__ = __gt__ = __ge__ = __add__ = __mul__ = __neg__ = __abs__ = _raise

    def __hash__(self) -> int:
        """Return an id: it can be an entry of sets and mappings."""
        return 0


class RaisingText:
    """An object that has no text."""

    def __repr__(self) -> str:
        """Raise."""
        raise RuntimeError("no text")

    __str__ = __repr__


class LongText:
    """An object whose text has many lines."""

    def __repr__(self) -> str:
        """Return them."""
        return "line\n" * 1000


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A class of wrong values: ``make`` makes one, given a folder that has files in it.

    It is no fault for arguments of the kinds in ``fits``, perhaps one for those in ``doubtful``, and one for the
    others.
    """

    name: str
    make: Callable[[Path], object]
    fits: frozenset[str] = frozenset()
    doubtful: frozenset[str] = frozenset()


def _fault(name: str, value: object, fits: str = "", doubtful: str = "") -> Fault:
    make = value if callable(value) and not isinstance(value, type) else lambda _: value
    return Fault(name=name, make=make, fits=frozenset(fits.split()), doubtful=frozenset(doubtful.split()))


FAULTS = (
    _fault("text", "abc", "text path"),
    _fault("text of a number", "3", "text path"),
    _fault("text of a truth value", "no", "text path"),
    _fault("empty text", "", "", "text"),
    _fault("bytes", b"abc"),
    _fault("None", None, "nothing"),
    _fault("a number", 5, "number size", "array anything"),
    _fault("a fraction", 2.5, "number", "array anything"),
    _fault("True", True, "flag"),
    _fault("complex", 1j),
    _fault("complex array", lambda _: np.array([1.0, 1j, 0.5])),
    _fault("complex array, real", lambda _: np.array([1.0, 0.2, 0.5]) + 0j),
    _fault("huge integer", 10**400),
    _fault("huge integers", lambda _: [10**400] * 3),
    _fault("NaN", float("nan")),
    _fault("array of NaN", lambda _: np.full(3, np.nan)),
    _fault("infinite", float("inf"), "", "number array anything"),
    _fault("minus infinite", float("-inf"), "", "number array anything"),
    _fault("overflow", 1e308, "", "number array anything"),
    _fault("overflow, negative", -1e308, "", "number array anything"),
    _fault("array of overflow", lambda _: np.full(3, 1e308), "", "array sequence anything"),
    _fault("negative", -1, "", "number size array anything"),
    _fault("zero", 0, "", "number size array anything"),
    _fault("empty list", lambda _: [], "", "array sequence"),
    _fault("empty mapping", lambda _: {}, "", "mapping"),
    _fault("mapping", lambda _: {"a": 1.0}, "", "mapping"),
    _fault("mapping to text", lambda _: {"a": "b"}, "", "mapping"),
    _fault("set", lambda _: {1.0, 2.0}),
    _fault("ragged", lambda _: [1.0, [2.0, 3.0]]),
    _fault("masked", lambda _: np.ma.array([0.1, 0.2, 0.3], mask=[False, True, False])),
    _fault("list of text", lambda _: ["a", "b", "c"], "", "sequence"),
    _fault("list of truth values", lambda _: [True, False, True], "", "sequence"),
    _fault("list of None", lambda _: [None, None, None]),
    _fault("array of objects", lambda _: np.array([object()] * 3)),
    _fault("array of four dimensions", lambda _: np.zeros((2, 3, 4, 5))),
    _fault("array of 97", lambda _: np.zeros(97)),
    _fault("dates", lambda _: np.array(["2026-01-01"] * 3, dtype="datetime64[D]")),
    _fault("object", lambda _: object()),
    _fault("object that raises", lambda _: Raising()),
    _fault("object without text", lambda _: RaisingText()),
    _fault("object of many lines", lambda _: LongText()),
    _fault("class", int, "function"),
    _fault("function", lambda _: lambda *_: None, "function"),
    _fault("module", np),
    _fault("name =x", "=x", "", "text path"),
    _fault("name id", "id", "path", "text"),
    _fault("name with blanks", " x ", "", "text path"),
    _fault("name of a folder above", "../x", "", "text path"),
    _fault("text with NUL", "a\0b", "", "text"),
    _fault("text of two lines", "a\nb", "", "text path"),
    _fault("text that has no bytes", "a\ud800", "", "text"),
    _fault("long text", "a" * 5000, "", "text"),
    _fault("path of nothing", lambda folder: folder / "nowhere", "path"),
    _fault("path of a folder", lambda folder: folder, "", "path"),
    _fault("path in a file", lambda folder: folder / "file" / "x", "", "path"),
    _fault("path of a link to nothing", lambda folder: folder / "link", "", "path"),
    _fault("path of noise", lambda folder: folder / "noise", "", "path"),
)


@dataclass(frozen=True, kw_only=True)
class BadInput:
    """A class of wrong values for an argument; ``is_certain`` if it can have no meaning."""

    argument: Argument
    fault: Fault
    is_certain: bool


def bad_inputs(argument: Argument) -> Iterator[BadInput]:
    """Yield every class of values that is, or may be, wrong for an argument."""
    for fault in FAULTS:
        if not argument.kinds & fault.fits:
            yield BadInput(argument=argument, fault=fault, is_certain=not argument.kinds & fault.doubtful)


def make_files(folder: Path) -> None:
    """Make the files for the paths of bad inputs."""
    (folder / "file").write_bytes(b"")
    (folder / "noise").write_bytes(np.random.default_rng(0).bytes(4096))
    (folder / "link").symlink_to(folder / "nowhere")
