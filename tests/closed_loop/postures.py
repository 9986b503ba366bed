"""Postures on the paper's circles, near given ones."""

from __future__ import annotations

import numpy as np

from paretoik.task.retraction import task_errors
from problems import marcos_2012

GUESS = {3: [0.3, 0.65, 1.0], 4: [0.3, 0.5, 0.8, 1.0]}


def posture(links, distance=0.7):
    """Return joint positions with the tool where the circle begins."""
    q = np.array(GUESS[links])
    task = marcos_2012.loop(links, distance, start=q, steps=3).task
    for _ in range(50):
        error, jacobian = task_errors(task.arm, task.tasks, q[None], task.targets[:1])
        q = q + np.linalg.pinv(jacobian[:, :, 0]) @ error[:, 0]
    assert np.abs(error).max() < 1e-9
    return q
