"""The units that quantities of an arm's joints have, which turn or slide."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from paretoik.robot.arm import Arm


def joint_units(arm: Arm, units: tuple[str, str]) -> str:
    """Return the units of an arm's joints of two, of turning and of sliding ones."""
    (turning, straight), sliding = units, is_sliding(arm)
    return " or ".join(dict.fromkeys([turning] * bool((~sliding).any()) + [straight] * bool(sliding.any())))


def has_masses(arm: Arm) -> bool:
    """Say whether an arm has masses or inertias, without which its torques and powers are 0 whatever it does."""
    return any(body.mass > 0.0 or bool(np.any(body.inertia)) for body in arm.bodies)


def is_sliding(arm: Arm) -> Bool[np.ndarray, " dof"]:
    """Say which joints slide."""
    return np.array([kind == "prismatic" for kind in arm.joint_types])
