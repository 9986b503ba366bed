"""Size and order of the library: ``python -m studies.benchmarks.sizes [--before DIR] [--json FILE]``.

It counts lines and lines of code (statements only) of every package, and what has a budget. Functions with many
parameters: public ones and commands aside. Circles: imports inside functions and for type checks count too.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from studies.benchmarks.checkouts import ROOT
from studies.reporting import Row, report, study_parser

MOST_FILE, LEAST_FILE, MOST_FUNCTION, MOST_PARAMETERS = 600, 40, 60, 10
Function = ast.FunctionDef | ast.AsyncFunctionDef
Imports = Mapping[str, set[str]]


@dataclass(kw_only=True)
class Sizes:
    """Lines and lines of code by package; the names of what is counted, with their sizes if they have one."""

    lines: Counter[str] = field(default_factory=Counter)
    code: Counter[str] = field(default_factory=Counter)
    files: dict[str, int] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, int] = field(default_factory=dict)
    constants: list[str] = field(default_factory=list)
    single_importer: list[str] = field(default_factory=list)
    used_once: list[str] = field(default_factory=list)
    circles: list[tuple[str, ...]] = field(default_factory=list)
    public: int = 0


def measure(library: Path) -> Sizes:
    """Return the sizes of a library's folder."""
    sizes, trees = Sizes(), {}
    face = ast.parse((library / "__init__.pyi").read_text(encoding="utf-8"))
    public = {alias.name for node in face.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    for file in sorted(library.rglob("*.py")):
        text, name = file.read_text(encoding="utf-8"), file.relative_to(library).as_posix()
        package = name.split("/")[0] if "/" in name else "(modules)"
        tree = trees[name] = ast.parse(text)
        sizes.files[name] = len(text.splitlines())
        sizes.lines[package] += sizes.files[name]
        sizes.code[package] += len(code_lines(tree))
        for function in (node for node in ast.walk(tree) if isinstance(node, Function)):
            last = function.end_lineno or function.lineno
            size = last - function.lineno + 1 - len(docstring_lines(function))
            if size > MOST_FUNCTION:
                sizes.functions[f"{name}:{function.name}"] = size
        for function in private_functions(tree, public) if package != "cli" else ():
            count = len([*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs])
            if count > MOST_PARAMETERS:
                sizes.parameters[f"{name}:{function.name}"] = count
        sizes.constants += [f"{name}:{constant}" for constant in numeric_constants(tree)]
        sizes.used_once += [f"{name}:{function}" for function in private_functions_used_once(tree)]
    imports = imported_files(trees)
    sizes.single_importer = list(files_with_one_importer(imports))
    sizes.circles = circles(imports)
    sizes.public = len(public)
    return sizes


def docstring_lines(node: Function | ast.ClassDef | ast.Module) -> set[int]:
    """Return the lines of a docstring."""
    first = node.body[0] if node.body else None
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        return set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return set()


def code_lines(tree: ast.Module) -> set[int]:
    """Return the lines that have a statement, without docstrings."""
    lines, docstrings = set[int](), set[int]()
    for node in ast.walk(tree):
        if isinstance(node, Function | ast.ClassDef | ast.Module):
            docstrings |= docstring_lines(node)
        if isinstance(node, ast.stmt | ast.expr | ast.arg):
            compound = isinstance(node, ast.stmt) and hasattr(node, "body")
            lines |= {node.lineno} if compound else set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines - docstrings


def numeric_constants(tree: ast.Module) -> Iterator[str]:
    """Yield the names in capitals that a module gives a number, or several.

    Names that are given numbers together, as ``A, B = range(2)``, are an enumeration or coefficients, and not counted.
    """
    for node in tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or isinstance(node.value, ast.Dict | None):
            continue
        numbers = [part.value for part in ast.walk(node.value) if isinstance(part, ast.Constant)]
        if numbers and all(isinstance(one, int | float) and not isinstance(one, bool) for one in numbers):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name) and target.id.lstrip("_").isupper():
                    yield target.id


def private_functions(tree: ast.Module, public: set[str]) -> Iterator[Function]:
    """Yield the functions that users do not call: neither ``public`` ones nor the methods of public classes."""
    for node in tree.body:
        if isinstance(node, Function | ast.ClassDef) and node.name not in public:
            yield from (each for each in ast.walk(node) if isinstance(each, Function))


def private_functions_used_once(tree: ast.Module) -> Iterator[str]:
    """Yield the private functions and methods that their file names once, other than to define them."""
    names = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    names.update(node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute))
    for node in ast.walk(tree):
        private = isinstance(node, Function) and node.name.startswith("_") and not node.name.endswith("__")
        if isinstance(node, Function) and private and names[node.name] == 1:
            yield node.name


def imported_files(trees: Mapping[str, ast.Module]) -> Imports:
    """Return the files of the library that each file imports, anywhere in it; packages' ``__init__`` do not count."""
    files = {name.removesuffix(".py").replace("/", "."): name for name in trees if not name.endswith("__init__.py")}
    imports: dict[str, set[str]] = defaultdict(set)
    for name, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("paretoik"):
                module = (node.module or "").removeprefix("paretoik").removeprefix(".")
                whole = [f"{module}.{alias.name}".removeprefix(".") for alias in node.names]
                imports[name] |= {files[each] for each in (module, *whole) if each in files} - {name}
    return imports


def files_with_one_importer(imports: Imports) -> Iterator[str]:
    """Yield the files that one file imports, and that one is in the same package."""
    importers: dict[str, set[str]] = defaultdict(set)
    for name, others in imports.items():
        for other in others:
            if not name.endswith("__init__.py"):
                importers[other].add(name)
    for name, others in sorted(importers.items()):
        if len(others) == 1 and name.split("/")[0] == next(iter(others)).split("/")[0]:
            yield name


def circles(imports: Imports) -> list[tuple[str, ...]]:
    """Return the groups of files that import each other, directly or by way of others."""
    names = sorted({*imports, *(other for others in imports.values() for other in others)})
    place = {name: i for i, name in enumerate(names)}
    edges = [(place[name], place[other]) for name, others in imports.items() for other in others]
    graph = csr_array((np.ones(len(edges)), np.array(edges).reshape(-1, 2).T), shape=(len(names), len(names)))
    groups: dict[int, list[str]] = defaultdict(list)
    for name, label in zip(names, connected_components(graph, connection="strong")[1].tolist(), strict=True):
        groups[label].append(name)
    return sorted(tuple(group) for group in groups.values() if len(group) > 1)


def tabulate(now: Sizes, before: Sizes | None) -> list[Row]:
    """Return all rows, with those of the checkout before as their reference."""

    def row(table: str, name: str, ours: float, former: float | None, note: str = "") -> Row:
        return Row(table, name, "now", "", ours, reference=former, source="before", note=note)

    rows = []
    for table, part in (("lines", "lines"), ("lines of code", "code")):
        counts, others = getattr(now, part), getattr(before, part) if before else Counter()
        packages = sorted({*counts, *others})
        rows += [row(table, name, counts[name], others[name] if before else None) for name in packages]
        rows.append(row(table, "all", counts.total(), others.total() if before else None))
    for name, goal, names in budgets(now):
        former = {key: value for key, _, value in budgets(before)} if before else {}
        rows.append(row("budgets", name, len(names), len(former[name]) if before else None, note(goal, names)))
    rows.append(row("budgets", "public names", now.public, before.public if before else None, "goal at most 66"))
    return rows


def budgets(sizes: Sizes) -> Iterator[tuple[str, int, Sequence[str]]]:
    """Yield what is limited, the goal, and the names of what counts."""
    files = sizes.files
    yield "files", 300, list(files)
    yield f"files above {MOST_FILE} lines", 0, [name for name, size in files.items() if size > MOST_FILE]
    short = [name for name, size in files.items() if size < LEAST_FILE and not name.endswith("__init__.py")]
    yield f"files below {LEAST_FILE} lines", 0, short
    yield f"functions above {MOST_FUNCTION} lines", 0, list(sizes.functions)
    yield f"functions with more than {MOST_PARAMETERS} parameters", 0, list(sizes.parameters)
    yield "files with one importer", 20, sizes.single_importer
    yield "private functions used once", 150, sizes.used_once
    yield "circles of imports", 0, [" ".join(group) for group in sizes.circles]
    yield "numeric constants of modules", 60, sizes.constants


def note(goal: int, names: Sequence[str]) -> str:
    """Return the goal, and which ones there are if they are few."""
    return f"goal at most {goal}" + (f"; {', '.join(names)}" if goal == 0 and names else "")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables, and write the rows where ``--json`` says."""
    parser = study_parser("Size and order of the library.")
    parser.add_argument("--before", type=Path, help="another checkout, counted too")
    options = parser.parse_args(arguments)
    before = measure(options.before / "paretoik") if options.before else None
    report(tabulate(measure(ROOT / "paretoik"), before), json_file=options.json)


if __name__ == "__main__":
    main()
