"""Tool paths saved in run folders.

The function that saves them belongs to a higher layer; ``paretoik`` registers it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from paretoik.capability.speed_models import SpeedModel
from paretoik.handed_down import HANDED_DOWN
from paretoik.inputs import check_flag

Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, eq=False)
class PathQuery:
    """A requested path: the ``verb``, ``start`` and ``target`` [m], and the ``settings``."""

    verb: str
    model: SpeedModel
    start: Float[np.ndarray, " task"]
    target: Float[np.ndarray, " task"]
    settings: Mapping[str, object]


def run_path(
    query: PathQuery,
    compute: Callable[[], Result],
    *,
    out: str | Path | None,
    overwrite: bool,
    observe: Callable[[Any], object] | bool | None,
) -> Result:
    """Return the result of ``compute``, saved in the folder ``out`` if there is one."""
    check_flag("overwrite", overwrite)
    if out is None and observe is None:  # the quick way, for thousands of paths
        return compute()
    result: Result = HANDED_DOWN["keep_path"](query, compute, out=out, overwrite=overwrite, observe=observe)
    return result
