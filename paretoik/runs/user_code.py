"""The parts of a function: its code, and the values that it finds outside."""

from __future__ import annotations
import __future__

import ast
import dis
import inspect
import linecache
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeAlias

# Origin of code: a library's, which is known by its name, or a user's, which is read.


OURS = "paretoik"
INSTALLED = ("/site-packages/", "/dist-packages/")
PYTHON = (sysconfig.get_path("stdlib"), "<frozen ")


def is_library(module: str | None, file: str | None = None) -> bool:
    """Return whether a module is ours, Python's, or installed; ``file`` is that of its code, if known."""
    name = module or ""
    if name.partition(".")[0] in {OURS, "builtins", *sys.stdlib_module_names}:
        return True
    place = file or getattr(sys.modules.get(name), "__file__", None)
    if place is None:
        return False
    return place.startswith(PYTHON) or any(folder in place.replace("\\", "/") for folder in INSTALLED)


def is_library_class(kind: type) -> bool:
    """Return whether a class is a library's."""
    return is_library(kind.__module__)


def is_library_module(module: ModuleType) -> bool:
    """Return whether a module is a library's."""
    return is_library(module.__name__, getattr(module, "__file__", None))


def library_name(value: Any) -> str:
    """Return the name of a library's function or class, without the module that defines it."""
    package = str(getattr(value, "__module__", None) or "").partition(".")[0]
    return f"{package}:{getattr(value, '__qualname__', type(value).__qualname__)}"


# The syntax tree of running code: from its source, if that is still what runs.


MUTATING = frozenset(
    {"append", "appendleft", "extend", "insert", "add", "update", "setdefault"}
    | {"pop", "popleft", "popitem", "clear", "remove", "discard"}
)  # methods of Python's containers
UNSAID = frozenset({"ctx", "kind", "type_comment", "type_params", "returns", "annotation", "type_ignores"})
Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
Place: TypeAlias = tuple[str, str | None]
"""A name and the meant attribute of it, None for the name itself."""


def syntax_of(code: CodeType, module_globals: dict[str, Any]) -> Function | None:
    """Return a function's syntax; None if its file cannot be read, or its compiled source is not what runs."""
    source = "".join(linecache.getlines(code.co_filename, module_globals))
    if not source:
        return None
    codes, functions = _parse(source, code.co_filename, code.co_flags & __future__.annotations.compiler_flag)
    if code not in codes:
        return None
    nodes = [node for node in functions if _start(node) == (code.co_name, code.co_firstlineno)]
    if len(nodes) > 1:  # lambdas in one line
        spans = set(code.co_positions())
        nodes = [node for node in nodes if isinstance(node, ast.Lambda) and _span(node.body) in spans]
    return nodes[0] if len(nodes) == 1 else None


@lru_cache(maxsize=32)
def _parse(source: str, file: str, flags: int) -> tuple[frozenset[CodeType], tuple[Function, ...]]:
    """Return all code objects and all functions of a source; none if it is not valid Python."""
    try:
        code = compile(source, file, "exec", flags=flags, dont_inherit=True)
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return frozenset(), ()
    functions = tuple(node for node in ast.walk(tree) if isinstance(node, Function))
    return frozenset(nested_codes(code)), functions


def nested_codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and all nested ones."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from nested_codes(constant)


def _start(node: Function) -> tuple[str, int]:
    if isinstance(node, ast.Lambda):
        return "<lambda>", node.lineno
    return node.name, min([node.lineno, *(each.lineno for each in node.decorator_list)])


def _span(node: ast.expr) -> tuple[int, int | None, int, int | None]:
    return node.lineno, node.end_lineno, node.col_offset, node.end_col_offset


def normalise(node: Function) -> str:
    """Return a function's syntax as text, the same for all layouts, annotations, documentation and Python versions.

    Decorators and defaults are left out: their results are at hand.
    """
    arguments = [_text(value) for name, value in ast.iter_fields(node.args) if "defaults" not in name]
    return f"{type(node).__name__} {arguments} {_text(node.body)}"


def _text(node: object) -> str:
    """Return a part of a syntax tree as text, "" if it is empty."""
    if isinstance(node, list):
        return "[" + ",".join(text for each in node if (text := _text(each))) + "]"
    if not isinstance(node, ast.AST):
        return repr(node)
    if isinstance(node, ast.Constant):
        return f"{type(node.value).__name__} {node.value!r}"
    if isinstance(node, ast.JoinedStr):
        return f"JoinedStr({_text(_merge_texts(node.values))})"
    if isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
        return ""
    if isinstance(node, ast.AnnAssign):
        return "" if node.value is None else f"Assign(targets=[{_text(node.target)}] value={_text(node.value)})"
    fields = [(name, value) for name, value in ast.iter_fields(node) if name not in UNSAID]
    return f"{type(node).__name__}({' '.join(f'{n}={_text(v)}' for n, v in fields if v is not None and v != [])})"


def _merge_texts(values: list[ast.expr]) -> list[ast.expr]:
    """Return the parts of a formatted string, with neighbouring texts merged: Python versions split them otherwise."""
    merged = list[ast.expr]()
    for each in values:
        if merged and isinstance(each, ast.Constant) and isinstance(merged[-1], ast.Constant):
            merged[-1] = ast.Constant(str(merged[-1].value) + str(each.value))
        else:
            merged.append(each)
    return [each for each in merged if not (isinstance(each, ast.Constant) and each.value == "")]


def read_names(node: Function) -> set[str]:
    """Return all names that a function reads, without those in annotations."""
    skipped = {
        id(inner)
        for each in ast.walk(node)
        for part in (getattr(each, "returns", None), getattr(each, "annotation", None))
        if isinstance(part, ast.AST)
        for inner in ast.walk(part)
    }
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and id(each) not in skipped}


def written_places(node: Function) -> set[Place]:
    """Return the places that a function changes beyond its local variables: names, and attributes of names.

    Items that are assigned or deleted and the methods that change Python's containers count too: what a call changes is
    the state of a computation, a cache or a count, and does not define the function.
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


def used_methods(node: Function) -> set[str]:
    """Return the names that a function takes from its first argument or from ``super()``; methods are among them."""
    first, attributes = first_argument(node), [each for each in ast.walk(node) if isinstance(each, ast.Attribute)]
    owners = [(each.attr, each.value.func if isinstance(each.value, ast.Call) else each.value) for each in attributes]
    return {name for name, owner in owners if isinstance(owner, ast.Name) and owner.id in (first, "super")}


def first_argument(node: Function) -> str:
    """Return the name of a function's first argument, "" without one."""
    arguments = [*node.args.posonlyargs, *node.args.args]
    return arguments[0].arg if arguments else ""


def _place(node: ast.expr) -> Place:
    """Return the name, and its attribute, that an expression starts from; "" if it starts from no name."""
    attribute = None
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Starred):
        attribute = node.attr if isinstance(node, ast.Attribute) else attribute
        node = node.value
    return (node.id if isinstance(node, ast.Name) else ""), attribute


# The parts of a function.


LOADS = {dis.opmap["LOAD_GLOBAL"]: 1, dis.opmap["LOAD_NAME"]: 0}  # number of bits that their arguments are shifted by


@dataclass(frozen=True, kw_only=True, eq=False)
class FunctionParts:
    """A function's ``code`` as text, and by name the ``values`` that it was made with or finds when it runs.

    ``node`` is its syntax, if the source is at hand and the code is not a library's.
    """

    code: str
    values: dict[str, object]
    node: Function | None


def function_parts(function: FunctionType) -> FunctionParts:
    """Return the parts of a function, without what it changes itself, such as its own cache."""
    code, module_globals = function.__code__, function.__globals__
    if is_library(function.__module__, code.co_filename):
        bare = inspect.unwrap(function)  # type checks that a user has put around it do not count
        return FunctionParts(code=library_name(bare), values=_closure(bare, set()), node=None)
    node = syntax_of(code, module_globals)
    written = set[Place]() if node is None else written_places(node)
    names = {name for name, _ in written}
    values = _closure(function, names) | _defaults(function, names)
    values |= {
        f"attribute {name}": value
        for name, value in vars(function).items()
        if name != "__wrapped__" and (function.__name__, name) not in written
    }
    loaded = set(_loaded(code)) if node is None else set(_loaded(code)) & read_names(node)
    for name in loaded & module_globals.keys() - names:
        values |= _reached(f"global {name}", module_globals[name], code)
    return FunctionParts(code=_bytecode(code) if node is None else normalise(node), values=values, node=node)


def _closure(function: FunctionType, written: set[str]) -> dict[str, object]:
    values = dict[str, object]()
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        if name not in written:
            try:
                values[f"closure {name}"] = cell.cell_contents
            except ValueError:  # it has no value yet
                values[f"closure {name}"] = "empty"
    return values


def _defaults(function: FunctionType, written: set[str]) -> dict[str, object]:
    positional = function.__code__.co_varnames[: function.__code__.co_argcount]
    defaults = function.__defaults__ or ()
    named = dict(zip(positional[len(positional) - len(defaults) :], defaults, strict=True))
    named |= function.__kwdefaults__ or {}
    return {f"default {name}": value for name, value in named.items() if name not in written}


def _loaded(code: CodeType) -> Iterator[str]:
    """Yield the names that code, and nested code, loads from its module."""
    for each in nested_codes(code):
        extended, instructions = 0, each.co_code
        for operation, argument in zip(instructions[::2], instructions[1::2], strict=True):
            index = extended << 8 | argument
            if operation in LOADS:
                yield each.co_names[index >> LOADS[operation]]
            extended = index if operation == dis.EXTENDED_ARG else 0


def _reached(label: str, value: object, code: CodeType) -> dict[str, object]:
    """Return a global value; for a user's module what code may take from it."""
    if not isinstance(value, ModuleType) or is_library_module(value):
        return {label: value}
    values = dict[str, object]()
    for name in {name for each in nested_codes(code) for name in each.co_names}:
        if name in vars(value):
            values |= _reached(f"{label}.{name}", vars(value)[name], code)
    return values


def _bytecode(code: CodeType) -> str:
    """Return code without source as text; every version of Python has its own."""
    constants = [_bytecode(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    return f"{sys.version_info[:2]} {code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def underlying(value: Any) -> FunctionType | None:
    """Return the Python function that a value is, or was compiled or wrapped from, None for others."""
    for _ in range(100):  # a decorator may wrap another's
        if isinstance(value, FunctionType):
            return value
        value = next((getattr(value, name) for name in ("__wrapped__", "py_func") if hasattr(value, name)), None)
    return None
