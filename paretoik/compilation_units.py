"""Whole-program compilation with numba: a function and all that it calls are optimised and emitted once, together.

By itself numba optimises and emits every function with all that it calls, and again in every caller: of code in many
small functions most of the compile time goes there. Here the libraries of inner functions hold LLVM code only; the
library of the function that Python calls links them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary


class _Library(JITCodeLibrary):
    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout  # optimised with what is linked


class InnerLibrary(_Library):
    """LLVM code of a function that other compiled functions call."""

    _shared_module: Any
    _linking_libraries: list[Any]

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.environments: list[tuple[str, Any]] = []
        self.own_module: Any = None

    @property
    def codegen(self) -> Any:
        """Where the environment of the function is set: kept until it is emitted."""
        return _DeferredCodegen(self)

    def finalize(self) -> None:
        """Finish the function's code: neither optimised nor emitted here."""
        self._raise_if_finalized()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0

    def _get_module_for_linking(self) -> Any:
        """Return the code with all that it calls, for libraries that are not of this module."""
        self._ensure_finalized()
        if self._shared_module is None:
            module = self.module_alone().clone()
            for library in linked_libraries(self._linking_libraries):
                module.link_in(_module_alone(library), preserve=True)
            self._shared_module = module
        return self._shared_module

    def module_alone(self) -> Any:
        """Return the code without what it calls, to be linked many times."""
        if self.own_module is None:
            module = self._final_module.clone()
            for function in module.functions:
                if not function.is_declaration and function.linkage.name == "external":
                    function.linkage = "linkonce_odr"
            self.own_module = module
        return self.own_module


class EntryLibrary(_Library):
    """Machine code of a function and of all that it calls."""

    _linking_libraries: list[Any]
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
        """Run LLVM's passes once; numba runs them twice, to remove reference counts that inner code has few of."""
        passes, builder = self._codegen._module_pass_manager(opt=self.level)
        passes.run(self._final_module, builder)


class _DeferredCodegen:
    """A code generator that keeps environments until their variables have addresses."""

    def __init__(self, library: InnerLibrary) -> None:
        self._library = library

    def set_env(self, name: str, environment: Any) -> None:
        self._library.environments.append((name, environment))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library._codegen, name)


def linked_libraries(libraries: list[Any]) -> list[Any]:
    """Return libraries and all that inner ones among them call, each once and callers first.

    LLVM links a function of many definitions only where what was linked before refers to it.
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
    """Create inner libraries for all functions that are compiled meanwhile, except ``entry``.

    LLVM optimises that one at a ``level`` of 3: 1 takes two thirds of the time, and most code is as fast.
    """
    before = codegen.__dict__.get("_library_class")

    def create(codegen: Any, name: str) -> Any:
        if name != entry:
            return InnerLibrary(codegen, name)
        library = EntryLibrary(codegen, name)
        library.level = level
        return library

    create._unserialize = JITCodeLibrary._unserialize  # what the cache loads
    codegen._library_class = create
    try:
        yield
    finally:
        if before is None:
            del codegen._library_class
        else:
            codegen._library_class = before
