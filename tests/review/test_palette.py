"""Rows that are spread evenly."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.palette import even_rows


@given(st.integers(1, 3000), st.integers(2, 300))
def test_rows_go_from_first_to_last_with_gaps_that_differ_by_at_most_one(count, largest):
    rows = even_rows(count, largest)
    assert len(rows) == min(count, largest)
    assert (rows[0], rows[-1]) == (0, count - 1)
    gaps = np.diff(rows)
    assert (gaps >= 1).all()
    assert gaps.max(initial=0) - gaps.min(initial=count) <= 1
