"""What a result depends on beside its inputs: versions of packages, and what the processor can do."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version

import numpy as np

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
