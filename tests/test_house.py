"""The house is in order: quick to import, its public names known, nothing in it that does not belong."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import paretoik
from paretoik import errors
from studies.benchmarks.sizes import circles, imported_files

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def library() -> dict[str, ast.Module]:
    """The syntax of the library's files, by their places in it."""
    folder = ROOT / "paretoik"
    files = sorted(folder.rglob("*.py"))
    return {file.relative_to(folder).as_posix(): ast.parse(file.read_text(encoding="utf-8")) for file in files}


def tracked() -> list[Path]:
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / line for line in listing.stdout.splitlines() if (ROOT / line).is_file()]


def test_how_a_class_is_made_is_not_told_in_the_words_of_a_library_below():
    """An editor shows a constructor's text next to the class's own: pymoo's speaks of other arguments."""
    classes = [value for value in (getattr(paretoik, name) for name in paretoik.__all__) if isinstance(value, type)]
    assert classes
    assert [each.__name__ for each in classes if "n_var:" in (inspect.getdoc(each.__init__) or "")] == []


def test_importing_paretoik_and_a_namespace_of_it_loads_nothing_heavy():
    heavy = ("pymoo", "cvxpy", "numba", "matplotlib", "rerun", "scipy", "pinocchio", "clarabel")
    script = f"import sys, paretoik as pk; pk.capability; print([name for name in {heavy} if name in sys.modules])"
    imported = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert imported.stdout.strip() == "[]"


def test_every_file_that_implements_steps_is_imported_by_another():
    """numba finds an implementation only if its file was imported; tests import all such files (conftest)."""
    trees = {file: file.read_text(encoding="utf-8") for file in (ROOT / "paretoik").rglob("*.py")}
    imports = re.compile(r"^ *from (\S+) import (\w+)|^ *import (\S+)", re.MULTILINE)
    imported = {".".join(filter(None, names)) for text in trees.values() for names in imports.findall(text)}
    implementing = [
        file.relative_to(ROOT) for file, text in trees.items() if re.search(r"^@implement\(", text, re.MULTILINE)
    ]
    assert len(implementing) == 2
    assert [str(file) for file in implementing if ".".join(file.with_suffix("").parts) not in imported] == []


def test_the_public_names_are_those_of_the_snapshot():
    snapshot = (Path(__file__).parent / "public_names.txt").read_text().split()
    assert sorted(paretoik.__all__) == snapshot
    assert len(snapshot) <= 80  # more names are too many to overlook: collections have namespaces


@pytest.mark.parametrize("name", sorted(paretoik.__all__))
def test_each_public_name_loads_and_says_what_it_is(name):
    item = getattr(paretoik, name)
    assert (item.__doc__ or getattr(item, "function", item).__doc__ or "").strip()


@pytest.mark.parametrize("namespace", [name for name in paretoik.__all__ if inspect.ismodule(getattr(paretoik, name))])
def test_each_name_of_a_namespace_says_what_it_is(namespace):
    module = getattr(paretoik, namespace)
    names = [name for name in dir(module) if not name.startswith("_")]
    public = [getattr(module, name) for name in names]
    own = [value for value in public if getattr(value, "__module__", "").startswith("paretoik.")]
    assert len(own) >= 4
    assert [
        value for value in own if not (value.__doc__ or getattr(value, "function", value).__doc__ or "").strip()
    ] == []


def raised(function: ast.FunctionDef) -> set[str]:
    """Return the names of our own errors that a function itself raises."""
    thrown = [node.exc for node in ast.walk(function) if isinstance(node, ast.Raise)]
    called = {node.func.id for node in thrown if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    return {name for name in called if inspect.isclass(getattr(errors, name, None))}


@pytest.mark.parametrize("name", sorted(paretoik.__all__))
def test_what_a_public_name_raises_stands_in_its_documentation(name):
    item = getattr(paretoik, name)
    item = getattr(item, "function", item)
    if not (inspect.isclass(item) or inspect.isfunction(item)):
        pytest.skip("neither a class nor a function")
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(item)))).body
    whole = ast.get_docstring(tree) or ""
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)] if inspect.isclass(item) else [tree]
    public = [node for node in functions if not node.name.startswith("_") or node.name in ("__init__", "__post_init__")]
    unsaid = {
        node.name: missing
        for node in public
        if (missing := {error for error in raised(node) if error not in whole + (ast.get_docstring(node) or "")})
    }
    assert unsaid == {}


def test_no_room_reaches_through_the_face(library):
    """The public names are for users; inside, a room is imported by its own name, or the contracts would not see it."""
    reached = [
        f"{file} imports {alias.name}"
        for file, tree in library.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "paretoik"
        for alias in node.names
        if alias.name in paretoik.__all__
    ]
    assert reached == []


def test_no_files_of_the_library_import_each_other_in_a_circle(library):
    """Not even by way of others, within functions, or for type checks."""
    assert circles(imported_files(library)) == []


@pytest.mark.slow
def test_the_modules_doctests_are_run():
    collected = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "paretoik/robot"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "paretoik/robot/arms.py::paretoik.robot.arms.tringali_3r" in collected.stdout


def test_every_slow_test_exists():
    for line in (ROOT / "tests" / "slow_tests.txt").read_text().splitlines():
        file, _, name = line.partition("[")[0].partition("::")
        names = {getattr(node, "name", None) for node in ast.parse((ROOT / file).read_text()).body}
        assert name in names or not name, line


def test_no_file_names_a_machine_or_a_registry():
    place = re.compile(rb"/(tm[p]|wor[k]|roo[t]|hom[e])/[a-z]|py[p]i[.]org|pythonhoste[d]|npmj[s][.]")
    assert [str(path) for path in tracked() if place.search(path.read_bytes())] == []


def test_no_tracked_file_is_large():
    assert [str(path) for path in tracked() if path.stat().st_size > 200_000] == []


def test_types_are_shipped():
    assert (ROOT / "paretoik" / "py.typed").is_file()
