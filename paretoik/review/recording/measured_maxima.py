"""What is recorded of directional maxima: the polygon, and how each of its corners is reached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from paretoik.capability.directional import PerformancePolygon
from paretoik.capability.joint_capability import Quantity, joint_speeds, torque_capacity
from paretoik.review.recording.workcell import Workcell
from paretoik.robot.dynamics import gravity_torques


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaScene:
    """The scene of directional maxima: where their postures are drawn, and what is maximised."""

    drawn_by: ClassVar[str] = "paretoik.review.drawing.whole_recording:WholeRecording"
    finished_by: ClassVar[str] = "paretoik.review.drawing.finished_maxima:FinishedMaxima"
    workcell: Workcell
    quantity: Quantity

    @property
    def unit(self) -> str:
        """Unit of the maxima."""
        return "m/s" if self.quantity == "velocity" else "N"

    @property
    def word(self) -> str:
        """What the maxima are of."""
        return "speed" if self.quantity == "velocity" else "force"


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaEnd:
    """The arrays of a polygon, as ``PerformancePolygon`` has them, and the ``provenance`` of its run.

    ``lower`` and ``upper`` (directions, dof) are what the motors let joints do in each posture: speeds [rad/s, m/s], or
    torques [N m, N].
    """

    directions: Float[np.ndarray, "directions task"]
    values: Float[np.ndarray, " directions"]
    q: Float[np.ndarray, "directions dof"]
    dq: Float[np.ndarray, "directions dof"]
    torque: Float[np.ndarray, "directions dof"]
    motor_speeds: Float[np.ndarray, "directions motors dof"]
    motor_efforts: Float[np.ndarray, "directions motors dof"]
    sliders: Float[np.ndarray, "directions 2 dof"] | None
    lower: Float[np.ndarray, "directions dof"]
    upper: Float[np.ndarray, "directions dof"]
    provenance: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.values)


def maxima_end(polygon: PerformancePolygon, provenance: Mapping[str, Any]) -> MaximaEnd:
    """Return a polygon as it is recorded."""
    if polygon.quantity == "velocity":
        speeds = joint_speeds(polygon.actuation, polygon.q, gravity_torques(polygon.arm, polygon.q))
        lower, upper = speeds.low, speeds.high
    else:
        capacity, _ = torque_capacity(polygon.actuation, polygon.q)
        lower, upper = -capacity, capacity
    return MaximaEnd(
        directions=polygon.directions,
        values=polygon.values,
        q=polygon.q,
        dq=polygon.dq,
        torque=polygon.torque,
        motor_speeds=polygon.motor_speeds,
        motor_efforts=polygon.motor_efforts,
        sliders=polygon.sliders,
        lower=lower,
        upper=upper,
        provenance=provenance,
    )
