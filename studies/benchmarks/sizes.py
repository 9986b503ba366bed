"""Size of the library: ``python -m studies.benchmarks.sizes [--before DIR] [--json FILE]``.

Counted are lines and code of every package (code: lines of statements, neither docstrings nor comments nor blank ones),
files above 300 lines, functions above 60 (docstrings not counted), numbers that are constants at the tops of modules,
and public names; with another checkout also its counts.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from studies.benchmarks.checkouts import ROOT
from studies.reporting import Row, report, study_parser

MOST_FILE, MOST_FUNCTION = 300, 60  # lines
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(kw_only=True)
class Sizes:
    """Lines and code of packages, and by name: long files, long functions; constants and public names."""

    lines: Counter[str] = field(default_factory=Counter)
    code: Counter[str] = field(default_factory=Counter)
    files: dict[str, int] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)
    constants: list[str] = field(default_factory=list)
    public: int = 0


def measure(library: Path) -> Sizes:
    """Return the sizes of a library's folder."""
    sizes = Sizes()
    for file in sorted(library.rglob("*.py")):
        text, name = file.read_text(encoding="utf-8"), file.relative_to(library).as_posix()
        package = name.split("/")[0] if "/" in name else "(modules)"
        tree, length = ast.parse(text), len(text.splitlines())
        sizes.lines[package] += length
        sizes.code[package] += len(code_lines(tree))
        if length > MOST_FILE:
            sizes.files[name] = length
        for function in (node for node in ast.walk(tree) if isinstance(node, Function)):
            last = function.end_lineno or function.lineno
            size = last - function.lineno + 1 - len(docstring_lines(function))
            if size > MOST_FUNCTION:
                sizes.functions[f"{name}:{function.name}"] = size
        sizes.constants += [f"{name}:{constant}" for constant in numeric_constants(tree)]
    face = ast.parse((library / "__init__.pyi").read_text(encoding="utf-8"))
    sizes.public = sum(len(node.names) for node in face.body if isinstance(node, ast.ImportFrom))
    return sizes


def docstring_lines(node: Function | ast.ClassDef | ast.Module) -> set[int]:
    """Return the lines of a docstring."""
    first = node.body[0] if node.body else None
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        return set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return set()


def code_lines(tree: ast.Module) -> set[int]:
    """Return the lines of statements, without docstrings."""
    lines, docstrings = set[int](), set[int]()
    for node in ast.walk(tree):
        if isinstance(node, Function | ast.ClassDef | ast.Module):
            docstrings |= docstring_lines(node)
        if isinstance(node, ast.stmt | ast.expr | ast.arg):
            compound = isinstance(node, ast.stmt) and hasattr(node, "body")
            lines |= {node.lineno} if compound else set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines - docstrings


def numeric_constants(tree: ast.Module) -> Iterator[str]:
    """Yield the names in capitals that a module assigns a number, or several.

    Names that are assigned together, as ``A, B = range(2)``, are an enumeration or coefficients, and not counted.
    """
    for node in tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or isinstance(node.value, ast.Dict | None):
            continue
        numbers = [part.value for part in ast.walk(node.value) if isinstance(part, ast.Constant)]
        if numbers and all(isinstance(one, int | float) and not isinstance(one, bool) for one in numbers):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name) and target.id.lstrip("_").isupper():
                    yield target.id


def tabulate(now: Sizes, before: Sizes | None) -> list[Row]:
    """Return all rows, with those of the other checkout."""

    def row(table: str, name: str, ours: float, former: float | None, note: str = "") -> Row:
        return Row(
            table=table, row=name, column="now", unit="", ours=ours, reference=former, source="before", note=note
        )

    rows = []
    for table, part in (("lines", "lines"), ("lines of code", "code")):
        counts, others = getattr(now, part), getattr(before, part) if before else Counter()
        packages = sorted({*counts, *others})
        rows += [row(table, name, counts[name], others[name] if before else None) for name in packages]
        rows.append(row(table, "all", counts.total(), others.total() if before else None))
    for name, part, goal in (
        (f"files above {MOST_FILE} lines", "files", 0),
        (f"functions above {MOST_FUNCTION} lines", "functions", 0),
        ("numeric constants of modules", "constants", 60),
        ("public names", "public", 60),
    ):
        count, other = (
            None if one is None else value if isinstance(value := getattr(one, part), int) else len(value)
            for one in (now, before)
        )
        assert count is not None
        long = getattr(now, part)
        which = ", ".join(f"{key} {size}" for key, size in long.items()) if isinstance(long, dict) else ""
        rows.append(row("what is long", name, count, other, f"goal at most {goal}; {which}".rstrip("; ")))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables, and write the rows if ``--json`` names a file."""
    parser = study_parser("Size of the library.")
    parser.add_argument("--before", type=Path, help="another checkout, counted too")
    options = parser.parse_args(arguments)
    before = measure(options.before / "paretoik") if options.before else None
    report(tabulate(measure(ROOT / "paretoik"), before), json_file=options.json)


if __name__ == "__main__":
    main()
