"""Settings of the API pages, one per public name: ``sphinx-build problems/api_pages build/api``, without network."""

from __future__ import annotations

import inspect
import re
from typing import Any

from sphinx.application import Sphinx

import paretoik
from paretoik.joint_trajectory.controllers import Controller
from paretoik.task.objectives import Objective


def kind(name: str) -> str:
    """Return the heading of a public name in the list of pages."""
    item = getattr(paretoik, name)
    kinds = {"Namespaces": inspect.ismodule, "Classes": inspect.isclass, "Functions": inspect.isfunction}
    return next((heading for heading, is_kind in kinds.items() if is_kind(item)), "Objectives")


PUBLIC = sorted(paretoik.__all__)
project, author, release = "paretoik", "The paretoik authors", paretoik.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]
templates_path = ["templates"]
exclude_patterns = ["templates"]
html_theme = "alabaster"
html_theme_options = {"page_width": "1200px", "description": paretoik.__doc__.partition("\n")[0]}
html_sidebars = {"**": ["about.html", "searchfield.html", "navigation.html"]}
html_copy_source = False
html_show_copyright = False
autosummary_context = {
    "kinds": {
        heading: [name for name in PUBLIC if kind(name) == heading]
        for heading in ("Functions", "Classes", "Objectives", "Namespaces")
    },
    "values": {
        f"paretoik.{name}": [
            key for key, item in vars(getattr(paretoik, name)).items() if isinstance(item, Objective | Controller)
        ]
        for name in PUBLIC
        if kind(name) == "Namespaces"
    },
    "modules": {f"paretoik.{name}": getattr(paretoik, name).__name__ for name in PUBLIC if kind(name) == "Namespaces"},
}
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
numpydoc_show_class_members = False
python_maximum_signature_line_length = 80

MARKUP = re.compile(r"``.*?``|[*|]")  # (*batch, time) and |τ| are no markup outside of literals
UNDERLINE = re.compile(r"-{3,}$")


def write_sections(app: Sphinx, what: str, name: str, item: Any, options: object, lines: list[str]) -> None:
    """Rewrite a docstring for numpydoc: prose and examples after a section get a heading of their own.

    The description of an objective is that of its function, of a controller the source of its figures. Text that only
    looks like markup is escaped.
    """
    if what == "data":
        text = item.source if isinstance(item, Controller) else inspect.getdoc(getattr(item, "function", item))
        lines[:] = (text or "").splitlines()
    section, is_doctest = "", False
    rewritten: list[str] = []
    for row, line in enumerate(lines):
        is_doctest = bool(line) and (is_doctest or line.startswith(">>>"))
        begins_paragraph = row > 0 and not lines[row - 1] and bool(line) and not line.startswith(" ")
        if row + 1 < len(lines) and UNDERLINE.match(lines[row + 1]):
            section = line
        elif section and begins_paragraph:
            heading = "Examples" if is_doctest else "Notes"
            rewritten += [heading, "-" * len(heading)] if heading != section else []
            section = heading
        rewritten.append(line if is_doctest else MARKUP.sub(escape, line))
    lines[:] = rewritten


def escape(match: re.Match[str]) -> str:
    """Return a match of MARKUP, escaped unless it is a literal."""
    return match[0] if len(match[0]) > 1 else f"\\{match[0]}"


def write_factories(
    app: Sphinx, what: str, name: str, item: Any, options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Return a signature in which a dataclass's default factory is an ellipsis, as in stubs."""
    return signature and signature.replace("<factory>", "..."), returns


def setup(app: Sphinx) -> None:
    """Rewrite docstrings before numpydoc reads them."""
    app.connect("autodoc-process-docstring", write_sections, priority=100)
    app.connect("autodoc-process-signature", write_factories)
