"""A user's code: its origin, the syntax that runs, and the outside values that a function uses."""

from __future__ import annotations
import __future__

import ast
import copy
import inspect
import linecache
import sys
import sysconfig
from collections.abc import Iterator
from functools import lru_cache
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, TypeAlias

# Origin of code: a library, identified by name, or a user, whose source is read.


OURS = "paretoik"
LIBRARIES = ("/site-packages/", "/dist-packages/", sysconfig.get_path("stdlib"), "<frozen ")  # parts of their places


def is_library(module: str | None, file: str | None = None) -> bool:
    """Return whether a module is paretoik's, Python's, or an installed one.

    ``file`` is the file of its code, if known.
    """
    name = module or ""
    if name.partition(".")[0] in {OURS, "builtins", *sys.stdlib_module_names}:
        return True
    place = file or getattr(sys.modules.get(name), "__file__", None) or ""
    return any(part in place for part in LIBRARIES)


def library_name(value: Any) -> str:
    """Return the name of a library's function or class, without the module that defines it."""
    package = str(getattr(value, "__module__", None) or "").partition(".")[0]
    return f"{package}:{getattr(value, '__qualname__', type(value).__qualname__)}"


def underlying(value: Any) -> FunctionType | None:
    """Return the Python function that a value is, or was compiled or wrapped from; None for others."""
    for _ in range(100):  # wrappers may be nested
        if isinstance(value, FunctionType):
            return value
        value = next((getattr(value, name) for name in ("__wrapped__", "py_func") if hasattr(value, name)), None)
    return None


# Syntax of running code, without comments, layout, annotations and documentation.


MUTATING = frozenset(
    {"append", "appendleft", "extend", "insert", "add", "update", "setdefault"}
    | {"pop", "popleft", "popitem", "clear", "remove", "discard"}
)  # methods of Python's containers
Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


class _Bare(ast.NodeTransformer):
    """Removes annotations, documentation and ``pass`` from a syntax tree."""

    def visit(self, node: Any) -> Any:
        if isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            return None
        if isinstance(node, ast.AnnAssign):
            if node.value is None:
                return None
            node = ast.Assign([node.target], node.value, lineno=node.lineno)
        for name in {"returns", "annotation"} & vars(node).keys():
            setattr(node, name, None)
        return self.generic_visit(node)


def syntax_of(function: FunctionType) -> Function | None:
    """Return a function's bare syntax; None if its source is missing, or compiles to other code than runs."""
    code = function.__code__
    source = "".join(linecache.getlines(code.co_filename, function.__globals__))
    codes, starts = _parse(source, code.co_filename, code.co_flags & __future__.annotations.compiler_flag)
    nodes = starts.get((code.co_name, code.co_firstlineno), []) if code in codes else []
    return nodes[0] if len(nodes) == 1 else None  # for several lambdas in one line the bytecode counts


@lru_cache(maxsize=32)
def _parse(source: str, file: str, flags: int) -> tuple[set[CodeType], dict[tuple[str, int], list[Function]]]:
    """Return a source's code objects, and functions by name and first line; both are empty if it is not Python."""
    try:
        code = compile(source, file, "exec", flags=flags, dont_inherit=True)
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return set(), {}
    starts: dict[tuple[str, int], list[Function]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Lambda):
            starts.setdefault(("<lambda>", node.lineno), []).append(node)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
            starts.setdefault((node.name, first), []).append(node)
    _Bare().visit(tree)
    return set(_nested(code)), starts


def _nested(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and all nested ones."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested(constant)


def written_places(node: Function) -> set[tuple[str, str | None]]:
    """Return the places that a function changes outside its local variables: a name, and its attribute or None.

    Assigned or deleted items count too, and calls of methods that change Python's containers. Values changed by a call
    are the state of a computation, a cache or a count, and do not define the function.
    """
    places: list[ast.expr] = []
    written = set[tuple[str, str | None]]()
    for each in ast.walk(node):
        if isinstance(each, ast.Global | ast.Nonlocal):
            written |= {(name, None) for name in each.names}
        elif isinstance(each, ast.Attribute | ast.Subscript) and not isinstance(each.ctx, ast.Load):
            places.append(each)
        elif isinstance(each, ast.Call) and isinstance(each.func, ast.Attribute) and each.func.attr in MUTATING:
            places.append(each.func.value)
    for place in places:
        attribute = None
        while isinstance(place, ast.Attribute | ast.Subscript | ast.Starred):
            attribute = place.attr if isinstance(place, ast.Attribute) else attribute
            place = place.value
        if isinstance(place, ast.Name):
            written.add((place.id, attribute))
    return written


# The parts of a function.


def function_parts(function: FunctionType) -> tuple[str, dict[str, object]]:
    """Return a function's code as text, and its outside values by name.

    These are its defaults, closure and attributes, and the globals that it reads, without values that it changes. A
    library's function has its name in place of code. If the source is missing, the text is the bytecode.
    """
    code, names = function.__code__, function.__globals__
    if is_library(function.__module__, code.co_filename):
        function = inspect.unwrap(function)  # a user's wrapper for type checks does not count
        return library_name(function), _closure(function)
    node = syntax_of(function)
    written = set() if node is None else written_places(node)
    parameters = inspect.signature(function, follow_wrapped=False).parameters.values()
    values = _closure(function) | {each.name: each.default for each in parameters if each.default is not each.empty}
    read = {name for each in _nested(code) for name in each.co_names}
    loaded = read & names.keys()
    if node is not None:  # names of attributes are no globals
        loaded &= {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    for name in loaded:
        values |= _reached(name, names[name], read)
    values = {name: value for name, value in values.items() if (name, None) not in written}
    values |= {
        f"attribute {name}": value
        for name, value in vars(function).items()
        if name != "__wrapped__" and (function.__name__, name) not in written
    }
    if node is None:
        return _bytecode(code), values
    # The source in a standard layout, without name, decorators and defaults.
    bare: Any = copy.copy(node)
    bare.args = copy.copy(node.args)
    bare.args.defaults, bare.args.kw_defaults = [], [None] * len(node.args.kwonlyargs)
    if not isinstance(node, ast.Lambda):
        bare.name, bare.decorator_list = "_", []
    return ast.unparse(bare), values


def _closure(function: FunctionType) -> dict[str, object]:
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    return {name: cell.cell_contents for name, cell in cells.items() if cell != CellType()}


def _reached(label: str, value: object, read: set[str]) -> dict[str, object]:
    """Return a global value by its label; for a user's module its attributes that are ``read``."""
    if not isinstance(value, ModuleType) or is_library(value.__name__):
        return {label: value}
    values = dict[str, object]()
    for name in read & vars(value).keys():
        values |= _reached(f"{label}.{name}", vars(value)[name], read)
    return values


def _bytecode(code: CodeType) -> str:
    """Return code as text, which depends on the version of Python."""
    constants = [_bytecode(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return f"{sys.version_info[:2]} {code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"
