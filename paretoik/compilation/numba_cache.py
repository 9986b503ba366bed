"""Compile functions with numba and cache them on disk.

Compilation happens once per machine, does not stop other threads, and is announced if it takes long. Other processes
that need the same function wait for it.

A function with ``@compiled`` has two variants with the same results. The one for compiled callers has no wrappers and
is not specialised by literal arguments. The one for Python is compiled at its first call, with all functions that it
calls, and cached in the package's folder, else in the user's, else in a temporary one. A function with ``@c_function``
is linked by its address: its callers do not optimise its code again.

Several classes below inherit from private classes of numba: pyproject.toml names its newest tested version.
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import os
import pickle
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import config, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, UserWideCacheLocator
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from paretoik.compilation_notices import CompilationNotice, begin_compilation, end_compilation

# Whole-program compilation with numba: a function and all functions that it calls are optimised and emitted once.
#
# Numba itself optimises and emits every function with all functions that it calls, again in every caller: in code of
# many small functions this takes most of the compile time. Here the libraries of inner functions have LLVM code only;
# the library of the function that Python calls links them all.


class _Library(JITCodeLibrary):
    _linking_libraries: list[Any]

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout  # optimised later with the linked code


class InnerLibrary(_Library):
    """LLVM code of a function that other compiled functions call."""

    _shared_module: Any

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.environments: list[tuple[str, Any]] = []
        self.own_module: Any = None

    @property
    def codegen(self) -> Any:
        """Code generator that stores the function's environment until emission."""
        return _DeferredCodegen(self)

    def finalize(self) -> None:
        """Finish the function's code; do not optimise or emit it."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0

    def _get_module_for_linking(self) -> Any:
        """Return the code linked with all functions that it calls, for numba's own libraries."""
        self._ensure_finalized()
        if self._shared_module is None:
            module = self.module_alone().clone()
            for library in linked_libraries(self._linking_libraries):
                module.link_in(_module_alone(library), preserve=True)
            self._shared_module = module
        return self._shared_module

    def module_alone(self) -> Any:
        """Return the code without called functions, to link it many times."""
        if self.own_module is None:
            module = self._final_module.clone()
            for function in module.functions:
                if not function.is_declaration and function.linkage.name == "external":
                    function.linkage = "linkonce_odr"
            self.own_module = module
        return self.own_module


class EntryLibrary(_Library):
    """Machine code of a function and of all that it calls."""

    level = 1

    def finalize(self) -> None:
        """Link, optimise and emit everything at once."""
        libraries = linked_libraries(self._linking_libraries)
        for library in libraries:
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(_module_alone(library), preserve=True)
        self._linking_libraries = []
        super().finalize()
        for library in libraries:
            for name, environment in getattr(library, "environments", []):
                if self._codegen._engine.get_global_value_address(name):
                    self._codegen.set_env(name, environment)

    def _optimize_final_module(self) -> None:
        """Run LLVM's passes once; numba's second run removes reference counts, which are rare in inner code."""
        passes, builder = self._codegen._module_pass_manager(opt=self.level)
        passes.run(self._final_module, builder)


class _DeferredCodegen:
    """A code generator that stores environments until their variables have addresses."""

    def __init__(self, library: InnerLibrary) -> None:
        self._library = library

    def set_env(self, name: str, environment: Any) -> None:
        self._library.environments.append((name, environment))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library._codegen, name)


def linked_libraries(libraries: list[Any]) -> list[Any]:
    """Return libraries and all those that inner ones call, callers first, each once.

    LLVM links a function with several definitions only if code that was linked before refers to it.
    """
    callees_first: dict[Any, None] = {}
    pending = [(library, False) for library in libraries]
    while pending:
        library, visited = pending.pop()
        if library in callees_first:
            continue
        if visited or not isinstance(library, InnerLibrary):
            callees_first[library] = None
            continue
        pending.append((library, True))
        pending += [(callee, False) for callee in library._linking_libraries]
    return list(reversed(callees_first))


def _module_alone(library: Any) -> Any:
    return library.module_alone() if isinstance(library, InnerLibrary) else library._get_module_for_linking()


@contextmanager
def compilation_unit(codegen: Any, entry: str = "", *, level: int = 1) -> Iterator[None]:
    """Create inner libraries for functions compiled in the body, except ``entry``.

    LLVM optimises ``entry`` at ``level``, at most 3. Level 1 compiles in two thirds of the time of level 3, and most
    code runs as fast.
    """

    def create(codegen: Any, name: str) -> Any:
        if name != entry:
            return InnerLibrary(codegen, name)
        library = EntryLibrary(codegen, name)
        library.level = level
        return library

    create._unserialize = JITCodeLibrary._unserialize  # called when the cache is loaded
    before = codegen.__dict__.get("_library_class", JITCodeLibrary)
    codegen._library_class = create
    try:
        yield
    finally:
        codegen._library_class = before


# Compilation of functions at their first call, and its cache.


# numba would read settings from a file in the current folder, which may be a run of unknown origin. They name the
# folder of the cache, from which code is loaded. Settings from environment variables remain valid.
config._config_fname = ""
config.reload_config()

carray = numba.carray  # an array at a pointer
OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}  # x / 0 is inf or nan
WITHOUT_WRAPPERS = {**OPTIONS, "no_cpython_wrapper": True}

# Functions with functions as arguments are inlined into their callers: otherwise nothing could be cached.
inlined = numba.njit(inline="always", nogil=True, error_model="numpy")


def compiled(function: Any = None, *, what: str = "", seconds: float | None = None, level: int = 1) -> Any:
    """Return a function that is compiled at its first call with each combination of argument types.

    what: purpose of the function, for the notice before a compilation
    seconds: approximate time of a compilation, for the notice
    level: optimisation level of LLVM, at most 3, if Python calls the function
    """
    if function is None:
        return lambda decorated: compiled(decorated, what=what, seconds=seconds, level=level)
    entry = _Entry(function, targetoptions=dict(OPTIONS))
    entry.level = level
    entry._cache = _cache(function, what, seconds)
    return entry


def c_function(signature: Any, *, what: str = "", seconds: float | None = None) -> Callable[[Any], Any]:
    """Return a decorator that compiles a function now, or loads it, for external calls from compiled code.

    ``signature`` may contain only numbers and pointers.
    """

    def decorate(function: Any) -> Any:
        callback = CFunc(function, normalize_signature(signature), locals={}, options={"error_model": "numpy"})
        callback._cache = _cache(function, what, seconds)
        codegen = callback._targetdescr.target_context.codegen()
        with _compiling(function, callback._cache), compilation_unit(codegen, function.__qualname__):
            callback.compile()
        symbol = f"{function.__module__}.{function.__qualname__}"
        llvm.add_symbol(symbol, callback.address)
        return types.ExternalFunction(symbol, callback._sig)

    return decorate


class _Inner(CPUDispatcher):
    """The variant of a function that compiled functions call."""

    def compile(self, sig: Any) -> Any:
        """Return a key to the code of a signature."""
        with compilation_unit(self.targetctx.codegen()):
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return the template of a call, with literal arguments as variables."""
        variables = {name: types.unliteral(arg) for name, arg in kws.items()}
        return super().get_call_template(tuple(types.unliteral(arg) for arg in args), variables)


class _Entry(CPUDispatcher):
    """The variant of a function that Python calls."""

    level = 1

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self.inner = _Inner(self.py_func, targetoptions=dict(WITHOUT_WRAPPERS))

    @property
    def _numba_type_(self) -> Any:
        return self.inner._numba_type_  # compiled callers use this variant

    def compile(self, sig: Any) -> Any:
        """Return the machine code for a signature."""
        unit = compilation_unit(self.targetctx.codegen(), self.py_func.__qualname__, level=self.level)
        with _compiling(self.py_func, self._cache), unit:
            return super().compile(sig)


@contextmanager
def _compiling(function: Any, cache: Any) -> Iterator[None]:
    """Hold the compiler's lock, and pause garbage collections, which take up to a quarter of the compile time."""
    with global_compiler_lock:
        collects = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            end_compilation(f"{function.__module__}.{function.__qualname__}")
            if isinstance(cache, _Cache):
                cache.unlock()
            if collects:
                gc.enable()


class _TemporaryLocator(UserWideCacheLocator):
    """The user's folder among temporary files, used if no other folder can be written."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        super().__init__(py_func, py_file)
        self._cache_path = str(_temporary_folder() / self.get_suitable_cache_subpath(py_file))


class _CacheImpl(CompileResultCacheImpl):
    _locator_classes = (*CompileResultCacheImpl._locator_classes, _TemporaryLocator)


class _Cache(FunctionCache):
    """The cache of a function with all that it calls; a process locks it while it compiles."""

    _impl_class = _CacheImpl

    def __init__(self, function: Any, notice: CompilationNotice) -> None:
        super().__init__(function)
        self.notice = notice
        self._lock: int | None = None  # descriptor of the locked file

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        overload = self._load(sig, target_context)
        if overload is None:
            begin_compilation()  # the clock of time limits stops
            with suppress(OSError):  # a folder without locks: several processes may compile
                self._impl.locator.ensure_cache_path()
                path = Path(self.cache_path) / f"{self._impl.filename_base}.lock"
                self._lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
                fcntl.lockf(self._lock, fcntl.LOCK_EX)  # a fork does not inherit it
            overload = self._load(sig, target_context)  # another process may just have compiled it
        if overload is None:
            begin_compilation(self.notice)
        return overload

    def unlock(self) -> None:
        """Release the lock: other processes can then load or compile the function."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _load(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (ImportError, AttributeError, EOFError, pickle.UnpicklingError):  # the file is cut off or outdated
            self.flush()
            return None

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return *super()._index_key(sig, codegen), _fingerprint(self._py_func)


def _cache(function: Any, what: str, seconds: float | None) -> Any:
    """Return the cache of a function; it stores nothing (``NullCache``) if no folder can be written."""
    try:
        return _Cache(function, CompilationNotice(what=what or function.__name__, seconds=seconds))
    except RuntimeError:  # no locator available
        return NullCache()


@cache
def _temporary_folder() -> Path:
    """Return a folder that only this user can write: code is loaded from it."""
    folder = Path(tempfile.gettempdir()) / f"paretoik-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and not status.st_mode & 0o077 and status.st_uid == os.getuid():
            return folder
    return Path(tempfile.mkdtemp(prefix="paretoik-"))


def _fingerprint(function: FunctionType) -> str:
    """Return a digest of the code and constants of a function and of all that its machine code contains."""
    reachable, pending = {function}, [function]
    while pending:
        for value in _globals(pending.pop()):
            if isinstance(value, CPUDispatcher) and value.py_func not in reachable:
                reachable.add(value.py_func)
                pending.append(value.py_func)
    return hashlib.sha256("".join(sorted(_digest(each) for each in reachable)).encode()).hexdigest()


@cache
def _digest(function: FunctionType) -> str:
    code = function.__code__
    constants = [value for value in code.co_consts if not isinstance(value, CodeType)]
    constants += [value for value in _globals(function) if isinstance(value, int | float | str | tuple)]
    return hashlib.sha256(code.co_code + repr(constants).encode()).hexdigest()


def _globals(function: FunctionType) -> list[Any]:
    """Return the globals that a function's code names."""
    return [function.__globals__.get(name) for name in function.__code__.co_names]
