"""Influences on a result next to its inputs: versions of packages, and the features of the processor."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

# One thread for the linear algebra libraries while a verb or a navigation computes, on every machine.
#
# The matrices are small: several threads wait for each other longer than they compute, and sums in another order could
# have other bits on a machine with another number of cores.


def single_blas_thread() -> AbstractContextManager[object]:
    """Return a context with one BLAS thread; its end restores the former number.

    The number belongs to the process: of contexts in several threads of Python the first one sets and restores it.
    """
    context: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return context


@cache
def _controller() -> Any:
    import scipy.linalg  # noqa: F401  # SciPy loads a BLAS of its own
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# How a child process is started: Python's own and installed modules come first, a user's files last.


def child_command(module: str, *arguments: str) -> list[str]:
    """Return the command of a child that calls ``main`` of a module and finds the modules that this process finds.

    Folders that only this process knows, such as that of a problem, come last: no file in them replaces a module of
    Python or of a library.
    """
    places = [place or str(Path.cwd()) for place in sys.path]
    path = f"sys.path += [place for place in {places!r} if place not in sys.path]"
    return [sys.executable, "-P", "-c", f"import sys; {path}; from {module} import main; main()", *arguments]


# Versions of packages, and features of the processor.


def versions() -> dict[str, str]:
    """Return the versions of the packages that a result depends on, by name."""
    return {name: version(name) for name in ("paretoik", "pymoo", "numpy", "scipy", "numba", "cvxpy", "clarabel")}


@cache
def processor() -> tuple[str, ...]:
    """Return the make of the processor and the extensions that NumPy found."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"]
    return (platform.machine(), *sorted({*extensions.get("baseline", ()), *extensions.get("found", ())}))


@cache  # it takes some milliseconds, and comes with every task
def software() -> Mapping[str, str]:
    """Return the versions that a worker must have, by name: only the same Python can read what is sent to it."""
    return {"Python": ".".join(platform.python_version_tuple()[:2]), **versions()}
