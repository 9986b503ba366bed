"""The papers' actuations."""

from __future__ import annotations

from typing import Literal

import numpy as np

from paretoik.capability.actuation import DistributedActuation, JointActuation
from paretoik.capability.motor_curves import MotorCurve


def kim_joint_motors() -> JointActuation:
    """Return the motors at the joints (JAM-3R) of Kim, Choi & Jang 2021, Table 3.

    >>> kim_joint_motors().motors.stall
    array([12.3,  3.5,  3.5])
    """
    return JointActuation(motors=MotorCurve(stall=[12.3, 3.5, 3.5], fastest=np.deg2rad([3.3, 13.2, 13.2])))


def kim_sliders(base_angle: float = float(np.deg2rad(-120.0)), bend: Literal[-1, 1] = 1) -> DistributedActuation:
    """Return the sliders (DAM-3R) of Kim, Choi & Jang 2021, Table 2; the first joint's upper speed is 1.8 mm/s.

    ``base_angle`` [rad] is where the link before the first joint points, ``bend`` the way in which all joints bend. The
    paper has neither: by default most directions at its nine positions are faster than with motors at the joints, as it
    says they are. Back sliders may be where front sliders may. Rods stay 10° from their toggles, which the paper does
    not say and which costs speed (``least_angle`` of ``DistributedActuation``).

    >>> kim_sliders().front_bounds[0].tolist()
    [0.037, 0.077]
    """
    return DistributedActuation(
        front=MotorCurve(stall=[195.9, 55.8, 55.8], fastest=[1.8e-3, 7.1e-3, 7.1e-3]),
        rod=0.080,
        front_bounds=(0.037, 0.077),
        zero=[base_angle, 0.0, 0.0],
        bend=bend,
    )
