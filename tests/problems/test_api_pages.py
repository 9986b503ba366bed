"""The API pages are built without network, by the command that problems/README.md prints, and miss no public name."""

from __future__ import annotations

import html
import inspect
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import pytest

import paretoik
from paretoik.task.objectives import Objective

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow  # it reads and writes about sixty pages


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    (command,) = re.findall(r"^sphinx-build .*$", (ROOT / "problems" / "README.md").read_text(), flags=re.MULTILINE)
    folder = tmp_path_factory.mktemp("checkout")
    place = Path("problems") / "api_pages"
    shutil.copytree(ROOT / place, folder / place, ignore=shutil.ignore_patterns("names"))
    arguments = [sys.executable, "-m", "sphinx", "-W", "--keep-going", *shlex.split(command)[1:]]
    built = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr  # a warning is an error
    return folder / shlex.split(command)[-1]


def text_of(page: Path) -> str:
    return html.unescape(re.sub(r"<[^>]+>", "", page.read_text(encoding="utf-8")))


def test_every_public_name_has_a_page_that_the_list_leads_to(pages):
    listing = (pages / "names" / "paretoik.html").read_text(encoding="utf-8")
    for name in paretoik.__all__:
        assert (pages / "names" / f"paretoik.{name}.html").is_file()
        assert f'href="paretoik.{name}.html"' in listing


def test_every_page_says_what_its_name_is(pages):
    for name in paretoik.__all__:
        item = getattr(paretoik, name)
        said = inspect.getdoc(getattr(item, "function", item))
        first_words = re.findall(r"\w+", said.partition("\n")[0])
        words = re.findall(r"\w+", text_of(pages / "names" / f"paretoik.{name}.html"))
        assert " ".join(first_words) in " ".join(words), name


def test_every_name_of_a_namespace_stands_on_its_page(pages):
    for namespace in (name for name in paretoik.__all__ if inspect.ismodule(getattr(paretoik, name))):
        module = getattr(paretoik, namespace)
        page = (pages / "names" / f"paretoik.{namespace}.html").read_text(encoding="utf-8")
        kinds = (type, FunctionType, Objective)  # not type variables
        items = [(name, item) for name, item in vars(module).items() if isinstance(item, kinds)]
        own = [name for name, item in items if getattr(item, "function", item).__module__ == module.__name__]
        public = getattr(module, "__all__", [name for name in own if not name.startswith("_")])
        missing = [name for name in public if f'.{name}"' not in page]
        assert public
        assert missing == []


def test_shapes_and_errors_can_be_read(pages):
    solve = text_of(pages / "names" / "paretoik.solve.html")
    assert "initial: Float[ndarray, 'points genes'] | Motion | Front | None = None" in " ".join(solve.split())
    raises = solve[solve.index("Raises:") : solve.index("Notes")]
    assert [error for error in ("InvalidInput", "Infeasible", "EvaluationFailed") if error not in raises] == []
    assert "Ctrl-C and SIGTERM end the search" in solve[solve.index("Notes") :]


def test_nothing_on_the_pages_is_loaded_from_elsewhere(pages):
    loaded = re.compile(r'<(?:script|img|link)[^>]+(?:src|href)="(?:https?:)?//')
    assert [page.name for page in pages.rglob("*.html") if loaded.search(page.read_text(encoding="utf-8"))] == []
