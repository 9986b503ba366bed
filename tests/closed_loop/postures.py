"""Postures on the paper's circles, near given ones, and a loop near an obstacle."""

from __future__ import annotations

import numpy as np

from paretoik.collision.obstacles import Circle
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from paretoik.task.retraction import task_errors
from problems import marcos_2012

GUESS = {3: [0.3, 0.65, 1.0], 4: [0.3, 0.5, 0.8, 1.0]}


def posture(links, distance=0.7):
    """Return joint positions with the tool at the beginning of the circle."""
    q = np.array(GUESS[links])
    task = marcos_2012.loop(links, distance, start=q, steps=3).task
    for _ in range(50):
        error, jacobian = task_errors(task.arm, task.tasks, q, task.targets[0])
        q = q + np.linalg.pinv(jacobian) @ error
    assert np.abs(error).max() < 1e-9
    return q


def near_obstacle(population=60):
    """Return a loop whose arm must slide past a disc."""
    start = posture(3)
    joints = np.concatenate([[0.0], np.cumsum(np.exp(1j * np.cumsum(start)))])
    center = (joints[1] + joints[2]) / 2 + 0.11j * (joints[2] - joints[1])
    disc = Circle([center.real, center.imag], 0.1)
    return ClosedLoop(
        marcos_nr(3),
        marcos_2012.round_trip(0.7, 25),
        start=start,
        obstacles=[disc],
        population=population,
        generations=40,
        weights=[0.1, 0.9],
    )
