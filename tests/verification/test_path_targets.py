from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.verification.path_targets import path_points, sample_points

LAWS = ("raised-cosine", "quintic")
END = pk.Pose.from_rpy([0.1, 0.2, 0.3], [1.0, 0.2, 0.3])
SHAPES = {
    "line": lambda **law: pk.line([0.4, 0.0], [0.1, 0.2], duration=2.0, samples=31, **law),
    "poses": lambda **law: pk.line(pk.Pose([0.4, 0.0, 0.1]), END, duration=2.0, samples=31, **law),
    "circle": lambda **law: pk.circle([0.4, 0.1], 0.1, duration=2.0, samples=31, **law),
    "waypoints": lambda **law: pk.waypoints([[0, 0], [1, 1], [2, 0]], duration=1.0, samples=31, **law),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("shape", SHAPES)
def test_paths_worked_out_from_their_numbers_pass_through_their_samples(shape, law):
    path = SHAPES[shape](timing=law)
    for ours, theirs in zip(path_points(path, path.times), sample_points(path), strict=True):
        assert (ours is None) == (theirs is None)
        if ours is not None:
            np.testing.assert_allclose(ours, theirs, atol=1e-13)
