"""Bad inputs, and their outcomes: refused in one good line before any work, accepted, or worse.

Bad inputs are classes of wrong values, each with the kinds of arguments for which it may have a meaning, or is wrong.
"""

from __future__ import annotations

import inspect
import os
import re
import time
import warnings
from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from paretoik.errors import InvalidInput, ParetoikError
from paretoik.inputs import cause_of
from studies.benchmarks.reliability.inputs.examples import PARTS, STARS, Examples
from studies.benchmarks.reliability.inputs.surfaces import Argument, Surface

ACCEPTED = {
    "Bounds(then): huge integer": "the id of a point, looked for in the front when it chooses",
    "Bounds(then): *": "the id of a point, looked for in the front when it chooses",
    "Classify(current): huge integer": "the id of a point, looked for in the front when it chooses",
    "Front(problem): *": "whatever the front was made of; a verb that needs it asks for what it needs",
    "TimeOptimalControl(*): array of overflow": "a number for each of a batch of motions",
    "capability.kim_sliders(bend): negative": "the other way in which joints bend",
    "Limits(*): None": "the arm's own limits",
    "Limits(*): *mapping": "limits by joint, held against the joints when there is an arm",
    "Limits(*): array of 97": "one limit a joint, held against the joints when there is an arm",
    "MaxiMin*(*tolerance): array of 97": "one tolerance a constraint, held against them when there is a problem",
    "MaxiMinNSGA2(sampling): list of truth values": "genes of a binary problem",
    "MaxiMinNSGA2(sampling): array of 97": "genes, held against the problem's when there is one",
    "Motion.at(t): array of 97": "times, all of them 0",
    "Motion.state(t): array of 97": "times, all of them 0",
    "Motion.integral(series): NaN": "the value of a failed evaluation",
    "Path.at(t): array of *": "times of any shape, all of them 0",
    "Path.rates(t): array of 97": "times, all of them 0",
    "arms.kim_3r(masses): None": "an arm without masses",
    "methods.*(*): array of *": "a number for each of a batch of motions",
    "methods.*(*): empty list": "a number for each of a batch of no motions",
}
"""Reasons by patterns of cases."""


def reason(case: str) -> str | None:
    """Return why a case is accepted, by its name; None if it must not be."""
    return next((why for pattern, why in ACCEPTED.items() if fnmatchcase(case, pattern)), None)


Verdict = Literal["good", "taken", "poor", "bad"]


class Outcome(NamedTuple):
    """The outcome of a case, and the words."""

    verdict: Verdict
    words: str


def outcome_of(call: Callable[[], object], words: str = ".") -> Outcome:
    """Return the outcome of a call: good is an error of ours, one printable line with the words (a pattern)."""
    try:
        call()
    except ParetoikError as refusal:
        text = str(refusal)
        return Outcome("good" if text.isprintable() and re.search(words, text) else "poor", text)
    except BaseException as error:
        return Outcome("bad", cause_of(error))
    return Outcome("bad", "taken")


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


class Fault(NamedTuple):
    """A class of wrong values: ``make`` makes one, given a folder that has files in it.

    Arguments of the kinds in ``fits`` may have the value, those in ``doubtful`` perhaps, others never.
    """

    name: str
    make: Callable[[Path], object]
    fits: frozenset[str]
    doubtful: frozenset[str]


def _fault(name: str, value: object, fits: str = "", doubtful: str = "") -> Fault:
    make = value if callable(value) and not isinstance(value, type) else lambda _: value
    return Fault(name, make, frozenset(fits.split()), frozenset(doubtful.split()))


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


def make_files(folder: Path) -> None:
    """Make the files for the paths of bad inputs."""
    (folder / "file").write_bytes(b"")
    (folder / "noise").write_bytes(np.random.default_rng(0).bytes(4096))
    (folder / "link").symlink_to(folder / "nowhere")


SECONDS = 0.25  # of the processor: most time of a refusal
WISH = re.compile(r"\b(wanted|wants?|must)\b")
FACT = re.compile(r"\bgot\b")


def message_faults(message: str, *, is_named: bool) -> list[str]:
    """Return the faults of a message; the caller says whether the thing is named."""
    good = {
        "not one line": message.isprintable(),
        "no name": is_named,
        "no wish": WISH.search(message),
        "no fact": FACT.search(message),
    }
    return [fault for fault, is_good in good.items() if not is_good]


class Case(NamedTuple):
    """A class of wrong values for an argument of a surface; ``is_certain`` if it can have no meaning."""

    surface: Surface
    argument: Argument
    fault: Fault
    is_certain: bool

    @property
    def name(self) -> str:
        """Return the surface, the argument and the class of the fault."""
        return f"{self.surface.name}({self.argument.name}): {self.fault.name}"


def cases(surfaces: list[Surface]) -> Iterator[Case]:
    """Yield every class of bad values of every argument."""
    for surface in surfaces:
        for argument in surface.arguments:
            for fault in FAULTS:
                if not argument.kinds & fault.fits:
                    yield Case(surface, argument, fault, not argument.kinds & fault.doubtful)


def judge(case: Case, examples: Examples) -> Outcome:
    """Call a surface with one bad argument, all others good, and judge the outcome."""
    surface, argument = case.surface, case.argument
    value = case.fault.make(examples.folder)
    others: dict[str, Any] = examples.arguments(surface, argument)
    function = surface.function if surface.owner is None else getattr(examples.owner(surface), surface.method)
    positional, named = [], {}
    for name, parameter in inspect.signature(function).parameters.items():
        if name == argument.name and argument.star == "**":
            named[str(STARS.get(surface.name, {}).get(name, "option"))] = value
        elif name != argument.name and parameter.kind is parameter.VAR_POSITIONAL:
            positional.extend(others.get(name, ()))
        elif name != argument.name and parameter.kind is parameter.VAR_KEYWORD:
            named.update(others.get(name, {}))
        elif name == argument.name or name in others:
            each = value if name == argument.name else others[name]
            if (argument.star == "*" and name == argument.name) or parameter.kind is parameter.POSITIONAL_ONLY:
                positional.append(each)
            else:
                named[name] = each

    def call() -> None:
        result = function(*positional, **named)
        if inspect.isgenerator(result):
            next(result)
        elif surface.name in ("objective", "constraint", "step_objective"):
            result(lambda motion: motion.q)

    before, began = sorted(os.walk(examples.folder)), time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            call()
        except InvalidInput as refusal:
            faults = message_faults(str(refusal), is_named=_is_named(case, str(refusal)))
            words = f"{', '.join(faults)}: {refusal}" if faults else str(refusal)
            outcome = Outcome("poor" if faults else "good", words)
        except ParetoikError as failure:
            outcome = Outcome("bad" if case.is_certain else "taken", str(failure))
        except Exception as error:
            outcome = Outcome("bad", cause_of(error))
        else:
            outcome = Outcome("taken", "")
    seconds = time.process_time() - began
    if warned:
        return Outcome("bad", f"warning: {warned[0].message}")
    if outcome.verdict == "good" and seconds > SECONDS:
        return Outcome("poor", f"after {seconds:.1f} s: {outcome.words}")
    if outcome.verdict == "good" and sorted(os.walk(examples.folder)) != before:
        return Outcome("poor", f"after files were written: {outcome.words}")
    return outcome


def _is_named(case: Case, message: str) -> bool:
    argument = case.argument
    names = {argument.name, argument.name.replace("_", " "), argument.name.removesuffix("s")}
    if argument.star:
        names.add(str(STARS.get(case.surface.name, {}).get(argument.name, "option")))
    if argument.is_unnamed or argument == case.surface.arguments[0]:
        names.add(case.surface.name.rpartition(".")[2])
    names.update(PARTS.get(f"{case.surface.name}({argument.name})", ()))
    value = case.fault.make(Path.cwd())
    is_told = "/" in message or (isinstance(value, str) and " ".join(value.split()) in message)
    if "path" in argument.kinds and is_told:
        return True  # a file is named by its path
    return any(re.search(rf"\b{re.escape(name)}\b", message, re.IGNORECASE) for name in names)
