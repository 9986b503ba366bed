from __future__ import annotations

import sys
import textwrap
from pathlib import Path

import pytest

from paretoik.errors import Infeasible, InvalidInput
from paretoik.loading import load_problem, problems_in

ROOT = Path(__file__).parents[1]
SIMPLE = '''
from functools import cache
from os import abort, getcwd
from pymoo.problems.multi.zdt import ZDT1

def small() -> ZDT1:
    """Three genes.

    More than one line.
    """
    return ZDT1(n_var=3)

def sized(genes: int = 4) -> ZDT1:
    return ZDT1(n_var=genes)

def needy(genes: int) -> ZDT1:
    return ZDT1(n_var=genes)

def unsaid():
    return ZDT1(n_var=5)

def text() -> str:
    return "no problem"

def broken() -> ZDT1:
    return 1 / 0

ready = ZDT1(n_var=6)

@cache
def remembered():
    return ZDT1(n_var=8)

class Callable:
    def __call__(self):
        raise AssertionError("called")

called = Callable()
_hidden = ZDT1(n_var=7)
'''


@pytest.fixture(autouse=True)
def as_before(monkeypatch, tmp_path):
    """Forget the entries of sys.path that a test adds, and the modules of its own files."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    modules_before = set(sys.modules)
    yield
    for name in set(sys.modules) - modules_before:
        module = sys.modules[name]
        places = [getattr(module, "__file__", None) or "", *getattr(module, "__path__", ())]
        if any(Path(place).is_relative_to(tmp_path) for place in places):
            del sys.modules[name]


@pytest.fixture
def file(tmp_path):
    def make(name: str, content: str) -> str:
        place = tmp_path / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(textwrap.dedent(content))
        return str(place)

    return make


def test_a_file_offers_its_own_problems_with_the_first_line_of_their_documentation(file):
    problems, _ = problems_in(file("simple.py", SIMPLE))
    assert problems.keys() == {"small", "sized", "broken", "ready"}
    assert problems["small"] == "Three genes."
    assert problems["sized"] == ""


@pytest.mark.parametrize(
    ("name", "genes"), [("sized", 4), ("unsaid", 5), ("ready", 6), ("ZDT1", 30), ("remembered", 8)]
)
def test_objects_functions_and_classes_without_required_arguments_are_problems(file, name, genes):
    assert load_problem(f"{file('simple.py', SIMPLE)}:{name}").n_var == genes


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "smal",
            r"must be one of .*simple\.py's: small, sized, broken, ready, perhaps unsaid, remembered "
            r"\(no return annotation\), got 'smal'; did you mean 'small'\?",
        ),
        ("needy", "must be a function without arguments, got one that needs genes"),
        ("text", "must be a pymoo problem or a function that returns one, got 'no problem'"),
        ("broken", r"cannot be built: ZeroDivisionError in line 26: division by zero"),
    ],
)
def test_a_name_that_is_no_problem_is_refused_with_the_reason(file, name, words):
    with pytest.raises(InvalidInput, match=words):
        load_problem(f"{file('simple.py', SIMPLE)}:{name}")


def test_a_file_of_functions_that_say_nothing_proposes_them(file):
    place = file(
        "mine.py", "from os import getcwd\ndef reach():\n    ...\ndef _reech():\n    ...\ndef far(x):\n    ...\n"
    )
    wish = r"one of .*mine\.py's: perhaps reach \(no return annotation\)"
    with pytest.raises(InvalidInput, match=rf"must be {wish}, got 'reech'; did you mean 'reach'\?"):
        load_problem(f"{place}:reech")
    with pytest.raises(InvalidInput, match=r"must be a problem or function in .*, which has none, got"):
        load_problem(f"{file('empty.py', '')}:reach")


def test_objects_that_have_every_attribute_are_no_problems_and_do_not_keep_others_from_being_read(file):
    place = file("mocking.py", "from unittest.mock import call\n\ndef reach():\n    return 3\n")
    assert problems_in(place) == ({}, ["reach"])
    with pytest.raises(InvalidInput, match=r"'s: perhaps reach .*got 'raech'; did you mean 'reach'"):
        load_problem(f"{place}:raech")


@pytest.mark.parametrize("name", ["abort", "called", "cache"])
def test_what_is_neither_the_files_own_function_nor_says_that_it_makes_a_problem_is_not_called(file, name):
    with pytest.raises(InvalidInput, match="must be a pymoo problem or a function that returns one, got <"):
        load_problem(f"{file('simple.py', SIMPLE)}:{name}")


def test_functions_of_other_modules_are_not_called():
    with pytest.raises(InvalidInput, match="must"):
        load_problem("os:abort")
    with pytest.raises(InvalidInput, match=r"from another module must be annotated, such as def f\(\) -> pk\.Tracking"):
        load_problem("paretoik.loading:shown")


@pytest.mark.parametrize("reference", ["mine.py", ":name"])
def test_a_reference_without_file_or_name_is_refused(reference):
    with pytest.raises(InvalidInput, match=r"must be FILE\.py:NAME or package\.module:NAME, got "):
        load_problem(reference)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("import nothing_of_the_kind", "module 'nothing_of_the_kind' is not installed"),
        ("def f(:", r"SyntaxError: invalid syntax \(faulty\.py, line 1\)"),
        ("\n\nraise KeyError('wrist\\nelbow')", r"KeyError in line 3: 'wrist\\nelbow'"),
        ("raise SystemExit(0)", "SystemExit in line 1: 0"),
        (
            "class A:\n    def __getattr__(self, name):\n        raise SystemExit(0)\nproblem = A()",
            "a pymoo problem or a",
        ),
        ("def problem():\n    raise SystemExit(0)", "cannot be built: SystemExit in line 2: 0"),
    ],
)
def test_a_file_that_cannot_be_loaded_is_one_line_with_its_place(file, content, words):
    with pytest.raises(InvalidInput, match=words) as refused:
        load_problem(f"{file('faulty.py', content)}:problem")
    assert "\n" not in str(refused.value)


def test_what_paretoik_raises_passes_through(file):
    place = file("hopeless.py", "from paretoik import Infeasible\ndef problem():\n    raise Infeasible('no motion')\n")
    with pytest.raises(Infeasible, match="no motion"):
        load_problem(f"{place}:problem")


def test_a_file_in_a_package_is_that_packages_module_and_its_root_goes_last(file, tmp_path):
    file("wood/__init__.py", "")
    file("wood/oak.py", "n_var = 2")
    place = file(
        "wood/arms.py", "from wood import oak\nfrom pymoo.problems.multi.zdt import ZDT1\np = ZDT1(oak.n_var)\n"
    )
    assert load_problem(f"{place}:p").n_var == 2
    assert load_problem(f"{place}:p").n_var == 2
    assert sys.path[-1] == str(tmp_path)
    assert sys.path.count(str(tmp_path)) == 1
    assert sys.modules["wood.arms"].__file__ == place


def test_a_dotted_module_is_found_from_the_current_folder(file, tmp_path, monkeypatch):
    file("stone.py", SIMPLE)
    monkeypatch.chdir(tmp_path)
    assert load_problem("stone:small").n_var == 3
    assert "small" in problems_in("stone")[0]


def test_a_package_of_the_same_name_that_is_loaded_already_is_named(file):
    load_problem(f"{ROOT / 'problems' / 'tringali_2020.py'}:energy_torque")
    loaded = sys.modules["problems"].__file__
    place = file("problems/__init__.py", SIMPLE)
    with pytest.raises(
        InvalidInput, match=f"package 'problems' in .* must have a unique name, got one already imported from {loaded}"
    ):
        load_problem(f"{place}:small")


def test_files_beside_a_problem_stand_in_for_no_module_of_python_or_a_library(file):
    assert "tabnanny" not in sys.modules
    for name in ("tabnanny", "pyarrow", "helpers"):
        file(f"{name}.py", "mine = True")
    place = file("uses.py", f"import helpers, tabnanny, pyarrow\n{SIMPLE}")
    assert load_problem(f"{place}:small").n_var == 3
    module = sys.modules["uses"]
    assert module.helpers.mine
    assert not hasattr(module.tabnanny, "mine")
    assert not hasattr(module.pyarrow, "mine")


def test_a_file_with_the_name_of_an_installed_package_is_the_users(file):
    sys.path.insert(0, str(Path(file("elsewhere/planks.py", "raise AssertionError")).parent))
    assert load_problem(f"{file('planks.py', SIMPLE)}:small").n_var == 3


def test_a_file_with_the_name_of_a_module_of_python_is_refused(file):
    with pytest.raises(InvalidInput, match="must not have the name of a Python module, got 'queue'; rename it"):
        load_problem(f"{file('queue.py', SIMPLE)}:small")
