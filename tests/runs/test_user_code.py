""""""

from __future__ import annotations

import linecache
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.runs.fingerprint import fingerprint
from tests.runs.every_syntax import EVERYTHING
from tests.runs.users_code import PREFIX, loader

ROOT = Path(__file__).parents[2]
SOURCE = """
from dataclasses import dataclass, field
from functools import lru_cache, partial
import numpy as np
from pymoo.core.problem import Problem
import paretoik as pk

SCALE = 2.0
TABLE = {"a": 1.0, "b": [1, 2]}
RESULTS = {}
COUNT = 0

@dataclass
class Weights:
    first: float = 0.3
    others: tuple = (1.0, 2.0)
    names: list = field(default_factory=lambda: ["a", "b"])

    def total(self):
        return self.first + sum(self.others)

WEIGHTS = Weights()

def helper(x):
    return np.abs(x) * SCALE

@lru_cache
def remembered(n):
    return n * 7

def factory(gain):
    count = 0
    def scaled(motion):
        nonlocal count
        count += 1
        return gain * motion.q[..., 0, 0]
    return scaled

@pk.objective(unit="rad", form="general")
def cost(motion, power=2, *, floor=0.5):
    global COUNT
    COUNT += 1
    RESULTS[COUNT] = motion
    first = [float(v) for v in (1, 2) if v > WEIGHTS.first]
    return helper(motion.q[..., 0, 0]) ** power + floor + TABLE["a"] + remembered(2) + len(first) + WEIGHTS.total()

made = pk.objective(unit="rad", form="general", name="made")(factory(1.5))
pair = [lambda x: x + 1, lambda x: x * 2]
part = partial(helper, 3.0)

class Base(Problem):
    offset = 1.0

    def shift(self, x):
        return x + self.offset

class Mine(Base):
    shared = {}

    def __init__(self, width=2.0):
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=1, xl=0.0, xu=1.0)
        self.calls = 0
        self.cache_of_mine = {}
        self.log = []
        self.set_up(width)

    def set_up(self, width):
        self.width = width
        self.matrix = np.eye(2) * width

    def set_width(self, width):
        self.width = width

    @property
    def half(self):
        self.halved = True
        return self.width / 2

    def count_call(self):
        self.calls += 1

    def _evaluate(self, x, out, *args, **kwargs):
        self.count_call()
        self.cache_of_mine[self.calls] = x
        Mine.shared[self.calls] = self.half
        self.log.append(x)
        self.last = x
        y = self.shift(x) @ self.matrix
        out["F"] = np.stack([y[:, 0], helper(y[:, 1]) - 1.0], axis=1)
        out["G"] = y[:, 0] - 9.0

problem = Mine()
"""
WHOLE = ("cost", "made", "pair", "part", "problem")

CHANGES = {
    "a body": ("** power + floor", "** power - floor"),
    "a default": ("power=2", "power=3"),
    "a global number": ("SCALE = 2.0", "SCALE = 2.5"),
    "a global table": ('"a": 1.0', '"a": 1.1'),
    "a body that is called": ("np.abs(x) * SCALE", "np.abs(x) / SCALE"),
    "a cached function": ("n * 7", "n * 8"),
    "a data class's default": ("first: float = 0.3", "first: float = 0.4"),
    "a data class's method": ("self.first + sum", "self.first - sum"),
    "a default factory": ('lambda: ["a", "b"]', 'lambda: ["a", "c"]'),
    "a closure": ("factory(1.5)", "factory(1.6)"),
    "a lambda": ("x + 1,", "x + 2,"),
    "a lambda in the same line": ("x * 2]", "x * 3]"),
    "a partial argument": ("partial(helper, 3.0)", "partial(helper, 4.0)"),
    "the form": ('made = pk.objective(unit="rad", form="general"', 'made = pk.objective(unit="rad", form="terminal"'),
    "a class attribute": ("offset = 1.0", "offset = 1.1"),
    "a base's method": ("x + self.offset", "x - self.offset"),
    "an attribute": ("width=2.0", "width=2.1"),
    "a property": ("self.width / 2", "self.width / 3"),
    "a constraint": ("y[:, 0] - 9.0", "y[:, 0] - 8.0"),
}
SAME = {
    "a comment": ("    return np.abs", "    # of its size\n    return np.abs"),
    "documentation": ("def helper(x):\n", 'def helper(x):\n    """Return it larger."""\n'),
    "layout": (
        "return gain * motion.q[..., 0, 0]",
        "return (\n            gain\n            * motion.q[..., 0, 0]\n        )",
    ),
    "annotations": ("def helper(x):", "def helper(x: np.ndarray) -> np.ndarray:"),
    "lines before": ("SCALE =", "\n\n\nUNUSED = 5\nSCALE ="),
    "a function that is not used": ("@lru_cache", "def other(x):\n    return x\n\n@lru_cache"),
    "a float among globals that is an integer": ("SCALE = 2.0", "SCALE = 2"),
}


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    yield loader(tmp_path_factory.mktemp("users"))
    for name in [name for name in sys.modules if name.startswith(PREFIX)]:
        del sys.modules[name]


@pytest.fixture(scope="module")
def before(load):
    return everything(load(SOURCE))


def everything(module) -> str:
    return fingerprint([getattr(module, name) for name in WHOLE])


def replaced(old: str, new: str) -> str:
    assert SOURCE.count(old) == 1
    return SOURCE.replace(old, new)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_another_body_value_or_class_is_another_problem(load, before, change):
    assert everything(load(replaced(*change))) != before


@pytest.mark.parametrize("change", SAME.values(), ids=SAME)
def test_what_computes_the_same_is_the_same_problem(load, before, change):
    source = replaced(*change)
    compile(source, "", "exec")
    assert everything(load(source)) == before


def test_a_moved_file_and_a_second_load_are_the_same_problem(load, before, tmp_path):
    assert everything(load(SOURCE)) == before
    (tmp_path / "elsewhere").mkdir()
    assert everything(loader(tmp_path / "elsewhere")(SOURCE)) == before


def test_solving_changes_nothing(load, before):
    module = load(SOURCE)
    pk.solve(module.problem, population=8, generations=2, seed=1)
    assert module.problem.calls > 1
    module.cost.function(SimpleNamespace(q=np.ones((2, 3, 3))))
    assert module.COUNT == 1
    assert module.remembered.cache_info().currsize == 1
    assert everything(module) == before


def test_a_problem_that_is_changed_by_hand_is_another(load, before):
    module = load(SOURCE)
    module.problem.set_width(5.0)
    assert everything(module) != before


def test_a_file_that_is_edited_after_it_was_loaded_stands_for_what_runs(load, before):
    module = load(SOURCE)
    Path(module.__file__).write_text(replaced("** power + floor", "** power - floor"))
    linecache.clearcache()
    edited = everything(load(Path(module.__file__).read_text()))
    assert everything(module) not in (before, edited)  # by bytecode: the file's source is not the code that runs


def test_every_version_of_python_with_this_scheme_has_the_same_fingerprint():
    # Python 3.11, 3.12 and 3.13 agree on it; if it must change, SCHEME changes too.
    assert fingerprint(EVERYTHING) == "4:4a57056433fe16f42ed1961a257290ed04f5591628183ca565dad732a8c858de"


def test_integers_that_no_float_tells_apart_are_different():
    assert len({fingerprint(2**70), fingerprint(2**70 + 1), fingerprint(np.array([2**60])), fingerprint(2**53)}) == 4


def test_code_without_a_file_is_told_apart_by_its_bytecode():
    def made(text):
        names = {}
        exec(f"def f(x):\n    return {text}\n", names)
        return fingerprint(names["f"])

    assert made("x + 1") == made("x + 1")
    assert len({made("x + 1"), made("x + 2"), made("x - 1")}) == 3


@pytest.mark.parametrize("seed", ["0", "31337"])
def test_every_process_has_the_same_fingerprint(load, before, tmp_path, seed):
    (tmp_path / "mine.py").write_text(SOURCE + "\nSETS = {'x', 'y', 'z'}\n")
    script = (
        "import mine; from paretoik.runs.fingerprint import fingerprint;"
        f"print(fingerprint([getattr(mine, n) for n in {WHOLE}]), fingerprint([mine.SETS, frozenset(mine.SETS)]))"
    )
    environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    child = subprocess.run(
        [sys.executable, "-c", script], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    sets = {"x", "y", "z"}
    assert child.stdout.split() == [before, fingerprint([sets, frozenset(sets)])]
