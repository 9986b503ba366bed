"""A Franka Emika Panda that moves its hand straight across a table: seven joints for six equations.

The robot is ``robots/panda.urdf``; ``robots/README.md`` has its origin and licence.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from paretoik import Arm, Pose, Tracking, joint_limit_distance, kinetic_energy, line, torque_norm

URDF = Path(__file__).parent / "robots" / "panda.urdf"
DOWN = (np.pi, 0.0, 0.0)  # roll, pitch, yaw of a hand that points at the table


def panda() -> Arm:
    """Return the Panda with its hand; the tool is the point between the fingertips."""
    return Arm.from_urdf(URDF, base="panda_link0", tip="panda_hand_tcp")


def across_the_table() -> Tracking:
    """Kinetic energy, torque norm and joint-limit distance, 0.5 m sideways in 1.5 s, the hand pointing down."""
    start, end = Pose.from_rpy((0.45, -0.25, 0.3), DOWN), Pose.from_rpy((0.45, 0.25, 0.3), DOWN)
    return Tracking(
        panda(),
        line(start, end, duration=1.5, samples=101),
        objectives=[kinetic_energy, torque_norm, joint_limit_distance],
        differences="backward",
    )
