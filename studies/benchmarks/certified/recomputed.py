"""Objectives of motions by Pinocchio: its dynamics at every instant, summed or maximised here."""

from __future__ import annotations

import numpy as np

from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from studies.benchmarks.kinematics import pinocchio_model

WITH_DYNAMICS = ("kinetic_energy", "torque_norm", "peak_torque")


def recomputed_difference(task: MotionTask, q: np.ndarray, values: np.ndarray, ranges: np.ndarray) -> float:
    """Return the largest difference of values (points, n_obj) from Pinocchio's, as a share of the ranges.

    Objectives that need no dynamics are left out.
    """
    columns = [k for k, objective in enumerate(task.objectives) if objective.name in WITH_DYNAMICS]
    others = np.array([recomputed_values(task, task.motion(one)) for one in q])
    return float((np.abs(others - values[:, columns]) / ranges[columns]).max())


def recomputed_values(task: MotionTask, motion: Motion) -> list[float]:
    """Return those objectives of a motion that need only Pinocchio's dynamics."""
    import pinocchio

    at, model = motion.instants, pinocchio_model(task.arm)
    data = model.createData()
    energy = np.array([pinocchio.computeKineticEnergy(model, data, *each) for each in zip(at.q, at.dq, strict=True)])
    torque = np.array([pinocchio.rnea(model, data, *each) for each in zip(at.q, at.dq, at.ddq, strict=True)])
    by_name = {
        "kinetic_energy": lambda: float(energy @ at.weights),
        "torque_norm": lambda: float(np.sum(torque**2, axis=1) @ at.weights),
        "peak_torque": lambda: float(np.abs(torque).max()),
    }
    return [by_name[objective.name]() for objective in task.objectives if objective.name in WITH_DYNAMICS]
