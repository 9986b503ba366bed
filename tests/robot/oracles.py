"""Quantities that only tests need, from their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.robot import kinematics
from paretoik.robot.arm import Arm

STEP = 1e-30  # of the complex step: its square is 0


def potential_energy(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return −Σ mᵢ g·cᵢ (*batch,) [J], zero at the world's origin."""
    energy = np.zeros(q.shape[:-1], dtype=q.dtype)
    links = replace(arm, frames={})  # the joints' own frames, not those of a file
    for joint, body in zip(arm.joint_names, arm.bodies, strict=True):
        rotation, position = kinematics.forward_kinematics(links, q, joint)
        energy = energy - body.mass * ((position + rotation @ body.center) @ arm.gravity)
    return energy


def jacobian_rate(arm: Arm, q: np.ndarray, dq: np.ndarray, frame: str = "<tool>") -> np.ndarray:
    """Return J̇ q̇ (*batch, 6) [m/s², rad/s²], J̇ by a complex step along q̇."""
    rate = kinematics.jacobian(arm, q + 1j * STEP * dq, frame).imag / STEP
    return np.einsum("...ij,...j->...i", rate, dq)
