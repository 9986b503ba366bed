"""Objects and files that are no problems, and the outcome of each: one line of our own, or worse."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pymoo.core.problem import Problem

import paretoik as pk
from paretoik.loading import load_problem
from problems import marcos_2012
from studies.benchmarks.reliability.inputs.judging import Outcome, Raising, RaisingText, outcome_of


class Untold(Exception):  # noqa: N818
    """An exception whose text raises."""

    def __str__(self) -> str:
        """Raise."""
        raise RuntimeError("no text")


class Own(BaseException):
    """An exception that does not derive from Exception."""


class Closed:
    """An object that raises when it is asked for an attribute."""

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError("closed")


class Odd(Problem):  # type: ignore[misc]  # pymoo is not typed
    """A pymoo problem with odd attributes, or one whose evaluation sets odd values or raises."""

    def __init__(self, values: Any = None, **odd: Any) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=int(odd.pop("constraints", 0)), xl=0.0, xu=1.0)
        self.values = values
        for name, value in odd.items():
            setattr(self, name, value)

    def _evaluate(self, x: np.ndarray, out: dict[str, Any], *arguments: Any, **named: Any) -> None:
        if isinstance(self.values, BaseException):
            raise self.values
        out.update({"F": x} if self.values is None else self.values(x))


def _set(name: str, value: object) -> Callable[[np.ndarray], dict[str, Any]]:
    """Return a function that sets F, G or H to a value, for any x."""
    return lambda x: {"F": x, name: value(x) if callable(value) else value}


ATTRIBUTES: dict[str, tuple[object, ...]] = {
    "n_var": (0, -1, None, "2", 2.5),
    "n_obj": (0, -1, None, "2", 2.5),
    "xl": (np.full(2, 2.0), np.full(2, np.nan), np.zeros(3), "low"),
    "names": (("a",), ("a", "a"), ("=x", "b"), ("\x1b[31ma", "b"), 5, (1, 2)),
    "units": (("m",), 5, (None, None)),
    "maximised": (("no", "yes"), (True,), 5),
}
RAISED = (SystemExit(0), GeneratorExit(), Untold(), Own("own"), MemoryError(), RecursionError())
VALUES: dict[str, object] = {
    "nothing": None,
    "text": "abc",
    "one column": lambda x: x[:, :1],
    "three columns": lambda x: np.ones((len(x), 3)),
    "another number of rows": lambda x: x[:-1],
    "complex": lambda x: x * 1j,
    "masked": lambda x: np.ma.array(x, mask=x > 0.5),
    "NaN": lambda x: np.full((len(x), 2), np.nan),
    "objects": lambda x: np.full((len(x), 2), object()),
    "a generator": lambda x: (row for row in x),
    "an object that raises": Raising(),
}


def objects() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield objects that are no problems, or have invalid attributes, by name."""
    yield from (
        ("None", lambda: None),
        ("a number", lambda: 5),
        ("text", lambda: "mine.py:problem"),
        ("an object", object),
        ("an object that raises", Raising),
        ("an object without text", RaisingText),
        ("an object whose attributes raise", Closed),
        ("a class", lambda: pk.Tracking),
        ("a pymoo class", lambda: Problem),
        ("an arm", pk.arms.tringali_3r),
    )
    named = {"names": ("a", "b"), "units": ("", ""), "maximised": (False, False)}
    for attribute, values in ATTRIBUTES.items():
        for value in values:
            odd = {**(named if attribute in named else {}), attribute: value}
            yield f"{attribute} {value!r}", partial(Odd, **odd)


def evaluations() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield problems whose evaluation raises or sets invalid values, by name."""
    for error in RAISED:
        yield f"an evaluation that raises {type(error).__name__}", partial(Odd, error)
    for what, value in VALUES.items():
        yield f"{what} for F", partial(Odd, _set("F", value))
        yield f"{what} for G", partial(Odd, _set("G", value), constraints=2)


HEAD = "import paretoik as pk, numpy as np, sys\nfrom problems.tringali_2020 import energy_torque\n"
RAISES = {
    "SystemExit": "sys.exit(0)",
    "GeneratorExit": "raise GeneratorExit",
    "its own BaseException": "class Own(BaseException): pass\n{0}raise Own('two\\nlines')",
    "an exception without text": "class E(Exception):\n{0}    def __str__(self): raise ValueError\n{0}raise E",
    "an escape sequence": "raise ValueError('\\x1b[31mred\\x1b]0;title\\x07')",
    "RecursionError": "f = lambda: f()\n{0}f()",
}
RETURNS = ("None", "5", "'text'", "pk.Tracking", "pk", "iter([])", "[energy_torque()]", "object()", "lambda: 5")
FILES: dict[str, str | bytes] = {
    "an empty file": "",
    "bad syntax": "def mine(:\n",
    "NUL": b"a\0b",
    "bytes of no text": b"\xff\xfe\xfa",
    "a missing import": "import nothing_of_the_kind\n",
    "a number for a problem": HEAD + "mine = 5\n",
    "a module for a problem": HEAD + "mine = np\n",
    "a factory with an argument": HEAD + "def mine(size): return energy_torque()\n",
    "a generator for a factory": HEAD + "def mine():\n    yield energy_torque()\n",
    "a class that needs arguments": HEAD + "class mine:\n    n_var = n_obj = 2\n    def __init__(self, size): pass\n",
    "an attribute that raises": HEAD + "def __getattr__(name): raise ValueError(name)\n",
    **{f"a module that raises {name}": HEAD + code.format("") + "\n" for name, code in RAISES.items()},
    **{
        f"a factory that raises {name}": HEAD + f"def mine():\n    {code.format('    ')}\n"
        for name, code in RAISES.items()
    },
    **{f"a factory that returns {value}": HEAD + f"def mine(): return {value}\n" for value in RETURNS},
}


SEARCHES: dict[str, Callable[[Any], object]] = {
    "Search(problem)": partial(pk.Search, population=8),
    "solve(problem)": partial(pk.solve, population=8, generations=2, observe=False),
}


def outcomes(folder: Path) -> Iterator[tuple[str, str, Outcome]]:
    """Yield the surface, the fault and the outcome, for every invalid problem."""
    searched = [("Search(problem)", each) for each in (*objects(), ("a closed loop", marcos_2012.circle_3r))]
    solved = [("solve(problem)", each) for each in (*objects(), *evaluations())]
    for surface, (name, make) in (*searched, *solved):
        yield surface, name, outcome_of(partial(SEARCHES[surface], make()))
    for number, (name, text) in enumerate(FILES.items()):
        file = folder / f"none_{number}.py"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        yield "problem files", name, outcome_of(partial(load_problem, f"{file}:mine"))
