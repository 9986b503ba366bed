"""Influences of the machine on results: package versions and processor features."""

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

# One thread for the linear algebra libraries during a verb or a navigation, on every machine.
#
# The matrices are small: several threads wait longer for each other than they compute. With another number of
# cores, sums would have another order, and perhaps other bits.


def single_blas_thread() -> AbstractContextManager[object]:
    """Return a context with one BLAS thread.

    At its end the former number is restored. The number belongs to the process: if several Python threads have such
    contexts, the first one sets and restores it.
    """
    context: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return context


@cache
def _controller() -> Any:
    import scipy.linalg  # noqa: F401  # SciPy loads a BLAS of its own
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# Start of a child process: Python's modules and installed ones have priority over a user's files.


def child_command(module: str, *arguments: str) -> list[str]:
    """Return the command of a child that calls a module's ``main``.

    The child finds the same modules as this process. Folders that only this process knows, such as a problem's, come
    last: their files replace no module of Python or of a library.
    """
    places = [place or str(Path.cwd()) for place in sys.path]
    path = f"sys.path += [place for place in {places!r} if place not in sys.path]"
    return [sys.executable, "-P", "-c", f"import sys; {path}; from {module} import main; main()", *arguments]


# Versions of packages, and features of the processor.


def versions() -> dict[str, str]:
    """Return the versions of packages that influence results, by name."""
    return {name: version(name) for name in ("paretoik", "pymoo", "numpy", "scipy", "numba", "cvxpy", "clarabel")}


@cache
def processor() -> tuple[str, ...]:
    """Return the make of the processor and the extensions NumPy found."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"]
    return (platform.machine(), *sorted({*extensions.get("baseline", ()), *extensions.get("found", ())}))


@cache  # it takes some milliseconds, and comes with every task
def software() -> Mapping[str, str]:
    """Return the versions that a worker must have, by name; pickles need the same version of Python."""
    return {"Python": ".".join(platform.python_version_tuple()[:2]), **versions()}
