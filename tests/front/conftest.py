from __future__ import annotations

import numpy as np
import pytest

from paretoik.front.front import Front
from paretoik.front.points import StoredJoints, StoredMotions


@pytest.fixture
def front() -> Front:
    """Five points of a trade-off with a maximised second objective, motions and genes, given unsorted."""
    x = np.array([3.0, 1.0, 5.0, 2.0, 4.0])
    rng = np.random.default_rng(0)
    motions = StoredMotions(
        arm=StoredJoints(joint_names=("shoulder", "elbow")),
        time=np.tile(np.linspace(0.0, 1.0, 4), (5, 1)),
        q=x[:, None, None] + rng.random((5, 4, 2)),
    )
    return Front(
        ids=np.array([30, 10, 50, 20, 40]),
        objectives=np.stack([x, x**2], axis=1),
        names=["energy", "reach"],
        units=["J s", "m"],
        maximised=[False, True],
        genes=np.stack([x, 10 * x], axis=1),
        motions=motions,
        violation=x * 1e-9,
        ranges=np.array([[0.0, 10.0], [0.0, 25.0]]),
        provenance={"status": "done", "seed": 1},
    )
