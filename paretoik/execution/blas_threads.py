"""One thread of the linear algebra libraries while a verb or a navigation computes, whatever the machine has.

The matrices are small: more threads wait for each other longer than they compute, and sums in another order could be
other bits on a machine with another number of cores.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


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
