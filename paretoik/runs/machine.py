"""What a result depends on beside its inputs: versions of packages, and what the processor can do."""

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

# One thread of the linear algebra libraries while a verb or a navigation computes, whatever the machine has.
#
# The matrices are small: more threads wait for each other longer than they compute, and sums in another order could
# be other bits on a machine with another number of cores.


def single_blas_thread() -> AbstractContextManager[object]:
    """Return a context with one BLAS thread; the number of before comes back at its end.

    The number is the process's: of contexts in several threads of Python the first one sets and restores it.
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

    The folders that only this process knows, as that of a problem, come last: no file in them stands in for a module of
    Python or of a library.
    """
    places = [place or str(Path.cwd()) for place in sys.path]
    path = f"sys.path += [place for place in {places!r} if place not in sys.path]"
    return [sys.executable, "-P", "-c", f"import sys; {path}; from {module} import main; main()", *arguments]


PACKAGES = ("paretoik", "pymoo", "numpy", "scipy", "numba", "cvxpy", "clarabel")  # whose versions a result depends on


def versions() -> dict[str, str]:
    """Return the versions of the packages that a result depends on, by name."""
    return {name: version(name) for name in PACKAGES}


@cache
def processor() -> tuple[str, ...]:
    """Return the make of the processor and the extensions that NumPy found it to have."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"]
    return (platform.machine(), *sorted({*extensions.get("baseline", ()), *extensions.get("found", ())}))


@cache  # it takes some milliseconds, and comes with every task
def software() -> Mapping[str, str]:
    """Return the versions that a worker has to have, by name: what is sent to it is read by the same Python alone."""
    return {"Python": ".".join(platform.python_version_tuple()[:2]), **versions()}


def difference(wanted: Mapping[str, str], got: Mapping[str, str]) -> str:
    """Return the first version that differs, in words, "" where none does."""
    for name, number in wanted.items():
        if got.get(name) != number:
            return f"{name} {number} wanted, got {got.get(name, 'none')}"
    return ""
