"""Rows that are evenly spread over many, the first and the last among them."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int


def even_rows(count: int, largest: int) -> Int[np.ndarray, " rows"]:
    """Return rows of ``count``, evenly spread and at most ``largest`` of them; all where there are not more.

    >>> even_rows(9, 3).tolist(), even_rows(2, 3).tolist(), even_rows(0, 3).tolist()
    ([0, 4, 8], [0, 1], [])
    """
    return np.unique(np.linspace(0, count - 1, min(count, largest)).round().astype(np.int64))
