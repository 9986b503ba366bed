"""Parts of a function: its source and its outside values."""

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
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeAlias

# Origin of code: a library, identified by name, or a user, whose source is read.


OURS = "paretoik"
INSTALLED = ("/site-packages/", "/dist-packages/")
PYTHON = (sysconfig.get_path("stdlib"), "<frozen ")


def is_library(module: str | None, file: str | None = None) -> bool:
    """Return whether a module is paretoik's, Python's, or an installed one.

    ``file`` is the file of its code, if known.
    """
    name = module or ""
    if name.partition(".")[0] in {OURS, "builtins", *sys.stdlib_module_names}:
        return True
    place = file or getattr(sys.modules.get(name), "__file__", None)
    if place is None:
        return False
    return place.startswith(PYTHON) or any(folder in place.replace("\\", "/") for folder in INSTALLED)


def is_library_module(module: ModuleType) -> bool:
    """Return whether a module is a library's."""
    return is_library(module.__name__, getattr(module, "__file__", None))


def library_name(value: Any) -> str:
    """Return the name of a library's function or class.

    The name excludes the module that defines it.
    """
    package = str(getattr(value, "__module__", None) or "").partition(".")[0]
    return f"{package}:{getattr(value, '__qualname__', type(value).__qualname__)}"


# Syntax of running code: taken from the source if that is unchanged, without the parts that compute nothing.


MUTATING = frozenset(
    {"append", "appendleft", "extend", "insert", "add", "update", "setdefault"}
    | {"pop", "popleft", "popitem", "clear", "remove", "discard"}
)  # methods of Python's containers
Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
Place: TypeAlias = tuple[str, str | None]
"""A name and the meant attribute of it, None for the name itself."""


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
    """Return a function's bare syntax, None if its source is not usable.

    The file cannot be read, or its compiled source differs from the running code.
    """
    code = function.__code__
    source = "".join(linecache.getlines(code.co_filename, function.__globals__))
    codes, starts = _parse(source, code.co_filename, code.co_flags & __future__.annotations.compiler_flag)
    nodes = starts.get((code.co_name, code.co_firstlineno), []) if code in codes else []
    if len(nodes) > 1:  # several lambdas in one line
        spans = set(code.co_positions())
        bodies = [node.body for node in nodes if isinstance(node, ast.Lambda)]
        places = [(each.lineno, each.end_lineno, each.col_offset, each.end_col_offset) for each in bodies]
        nodes = [node for node, place in zip(nodes, places, strict=False) if place in spans]
    return nodes[0] if len(nodes) == 1 else None


@lru_cache(maxsize=32)
def _parse(source: str, file: str, flags: int) -> tuple[set[CodeType], dict[tuple[str, int], list[Function]]]:
    """Return a source's code objects, and functions by name and first line.

    Both are empty if the source is not valid Python.
    """
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
    return set(nested_codes(code)), starts


def nested_codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and all nested ones."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from nested_codes(constant)


def _text(node: Function) -> str:
    """Return a function's source in a standard layout.

    Name, decorators and defaults are left out, since their values are known.
    """
    bare: Any = copy.copy(node)
    bare.args = copy.copy(node.args)
    bare.args.defaults, bare.args.kw_defaults = [], [None] * len(node.args.kwonlyargs)
    if not isinstance(node, ast.Lambda):
        bare.name, bare.decorator_list = "_", []
    return ast.unparse(bare)


def written_places(node: Function) -> set[Place]:
    """Return the places that a function changes outside its local variables.

    These are names, and attributes of names. Assigned or deleted items count too, and calls of methods that change
    Python's containers. Values changed by a call are the state of a computation, a cache or a count, and do not define
    the function.
    """
    places = set[Place]()
    for each in ast.walk(node):
        if isinstance(each, ast.Global | ast.Nonlocal):
            places |= {(name, None) for name in each.names}
        elif isinstance(each, ast.Attribute | ast.Subscript) and not isinstance(each.ctx, ast.Load):
            places.add(_place(each))
        elif isinstance(each, ast.Call) and isinstance(each.func, ast.Attribute) and each.func.attr in MUTATING:
            places.add(_place(each.func.value))
    return {(name, attribute) for name, attribute in places if name}


def _place(node: ast.expr) -> Place:
    """Return the name, and its attribute, that an expression starts from.

    If the expression starts from no name, the name is "".
    """
    attribute = None
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
        attribute = node.attr if isinstance(node, ast.Attribute) else attribute
        node = node.value
    return (node.id if isinstance(node, ast.Name) else ""), attribute


# The parts of a function.


def function_parts(function: FunctionType) -> tuple[str, dict[str, object]]:
    """Return a function's code as text, and its outside values by name.

    These are its defaults, closure and attributes, and the globals that it reads. Values that it changes, such as its
    own cache, are left out.
    """
    code, module_globals = function.__code__, function.__globals__
    if is_library(function.__module__, code.co_filename):
        bare = inspect.unwrap(function)  # a user's wrapper for type checks does not count
        return library_name(bare), _closure(bare)
    node = syntax_of(function)
    written = set() if node is None else written_places(node)
    positional = code.co_varnames[: code.co_argcount]
    defaults = function.__defaults__ or ()
    defaults_by_name = dict(zip(positional[len(positional) - len(defaults) :], defaults, strict=True))
    values = _closure(function) | {
        f"default {name}": value for name, value in (defaults_by_name | (function.__kwdefaults__ or {})).items()
    }
    values = {label: value for label, value in values.items() if (label.partition(" ")[2], None) not in written}
    values |= {
        f"attribute {name}": value
        for name, value in vars(function).items()
        if name != "__wrapped__" and (function.__name__, name) not in written
    }
    loaded = {name for each in nested_codes(code) for name in each.co_names} & module_globals.keys()
    if node is not None:
        loaded &= {each.id for each in ast.walk(node) if isinstance(each, ast.Name)} - {name for name, _ in written}
    for name in loaded:
        values |= _reached(f"global {name}", module_globals[name], code)
    return _bytecode(code) if node is None else _text(node), values


def _closure(function: FunctionType) -> dict[str, object]:
    values = dict[str, object]()
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            values[f"closure {name}"] = cell.cell_contents
        except ValueError:  # the variable has no value yet
            values[f"closure {name}"] = "empty"
    return values


def _reached(label: str, value: object, code: CodeType) -> dict[str, object]:
    """Return a global value by its label.

    For a user's module the attributes that the code may read are returned.
    """
    if not isinstance(value, ModuleType) or is_library_module(value):
        return {label: value}
    values = dict[str, object]()
    for name in {name for each in nested_codes(code) for name in each.co_names} & vars(value).keys():
        values |= _reached(f"{label}.{name}", vars(value)[name], code)
    return values


def _bytecode(code: CodeType) -> str:
    """Return code as text if its source is missing.

    The text depends on the version of Python.
    """
    constants = [_bytecode(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return f"{sys.version_info[:2]} {code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def underlying(value: Any) -> FunctionType | None:
    """Return the Python function behind a value, None for others.

    The value is this function, or was compiled or wrapped from it.
    """
    for _ in range(100):  # wrappers may be nested
        if isinstance(value, FunctionType):
            return value
        value = next((getattr(value, name) for name in ("__wrapped__", "py_func") if hasattr(value, name)), None)
    return None
