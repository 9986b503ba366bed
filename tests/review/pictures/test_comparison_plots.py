from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from paretoik.front.comparison import Comparison
from paretoik.review.pictures.fronts import _staircase, comparison_picture


@pytest.mark.parametrize("n_obj", [1, 2, 3, 5])
def test_every_comparison_gets_a_small_picture_that_shows_something(n_obj, tmp_path, make_front):
    front = make_front(n_obj, points=20, moving=False)
    shifted = replace(front, objectives=front.objectives * 1.1, ranges=front.ranges)
    comparison = Comparison(fronts=(front, shifted, front), labels=("$a$", "$a$", "b"))
    file = tmp_path / "fronts.png"
    comparison_picture(comparison, file)
    assert file.stat().st_size < 150_000
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("L"))
    assert 0.003 < (pixels < 200).mean() < 0.5


def test_a_staircase_bounds_what_its_points_dominate(make_front):
    comparison = Comparison(fronts=(make_front(2, moving=False),) * 2, labels=("a", "b"))
    stairs = _staircase(comparison, np.array([[1.0, 3.0], [2.0, 1.0]]), np.array([4.0, 5.0]))
    assert stairs.tolist() == [[1.0, 5.0], [1.0, 3.0], [2.0, 3.0], [2.0, 1.0], [4.0, 1.0]]
