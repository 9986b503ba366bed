"""The least time of a motion, and the work of its motors: in closed form, interval by interval.

Between two samples every motor travels so far under the load that gravity puts on it halfway; the slowest of them sets
the time. Quasi-static, as Kim, Choi & Jang 2021 are: what inertia asks for is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques


@dataclass(frozen=True, kw_only=True, eq=False)
class Timing:
    """The least times of the intervals between samples, and what motors do meanwhile.

    ``intervals`` (*batch, intervals) [s], NaN where a motor cannot bear its effort; ``travel`` and ``effort``
    (*batch, intervals, motors, dof) [rad or m, N m or N] and ``work``, their product without signs [J]; ``overload``
    (*batch,) is by how much the worst effort, there or at a sample, is more than its motor can bear, as a share,
    negative where it is not.
    """

    intervals: Float[np.ndarray, "*batch intervals"]
    travel: Float[np.ndarray, "*batch intervals motors dof"]
    effort: Float[np.ndarray, "*batch intervals motors dof"]
    overload: Float[np.ndarray, "*batch"]

    @property
    def work(self) -> Float[np.ndarray, "*batch intervals motors dof"]:
        """What each motor gives or takes [J]."""
        return np.abs(self.effort * self.travel)

    @property
    def duration(self) -> Float[np.ndarray, "*batch"]:
        """The least time of the whole [s]."""
        return np.asarray(self.intervals.sum(axis=-1))

    @property
    def energy(self) -> Float[np.ndarray, "*batch"]:
        """The work of all motors, given or taken [J]: braking costs as much as driving, nothing is recovered."""
        return np.asarray(self.work.sum(axis=(-1, -2, -3)))

    def lateness(self, allowed: Float[np.ndarray, "*batch coarse"]) -> Float[np.ndarray, "*batch"]:
        """Return by how much coarser intervals [s], of as many of these each, are too short at most, over their mean.

        An interval that no motor can bear does not count.
        """
        shortest = self.intervals.reshape(*allowed.shape, -1).sum(axis=-1)
        late = np.nan_to_num(shortest - allowed, nan=0.0).max(axis=-1) / allowed.mean(axis=-1)
        return np.asarray(late)


def minimum_timing(
    arm: Arm, actuation: Actuation, q: JointPaths, front: JointPaths, *, travel_tolerance: float = 1e-9
) -> Timing:
    """Return the timing of joint positions, and front sliders where there are any, at samples (*batch, time, dof).

    A motor that travels no more than the tolerance [rad, m] between samples rests, even under all it can bear.
    """
    middle = (q[..., 1:, :] + q[..., :-1, :]) / 2
    middle_front = (front[..., 1:, :] + front[..., :-1, :]) / 2
    effort = actuation.ratios(middle, middle_front) * gravity_torques(arm, middle)[..., None, :]
    static_effort = actuation.ratios(q, front) * gravity_torques(arm, q)[..., None, :]
    if isinstance(actuation, DistributedActuation):
        back = actuation.gears(q, front)[0]
        travel = np.stack([np.diff(front, axis=-2), np.diff(back, axis=-2)], axis=-2)
    else:
        travel = np.diff(q, axis=-2)[..., None, :]
    shares, times = list[np.ndarray](), list[np.ndarray]()
    for m, curve in enumerate(actuation.curves):
        low, high = curve.speeds(effort[..., m, :])
        change = travel[..., m, :]
        with np.errstate(divide="ignore", invalid="ignore"):
            times.append(np.where(np.abs(change) <= travel_tolerance, 0.0, change / np.where(change > 0, high, low)))
        times[-1] = np.where(np.isnan(high), np.nan, times[-1])
        shares += [np.abs(each[..., m, :]).max(axis=-2) / curve.stall for each in (effort, static_effort)]
    return Timing(
        intervals=np.stack(times, axis=-1).max(axis=(-1, -2)),
        travel=travel,
        effort=effort,
        overload=np.stack(shares, axis=-1).max(axis=(-1, -2)) - 1.0,
    )


def require_weight(arm: Arm) -> None:
    """Raise InvalidInput where motors work against nothing, whatever the posture."""
    if not gravity_torques(arm, np.random.default_rng(0).normal(size=(4, arm.dof))).any():
        raise InvalidInput(
            f"energy: an arm with weight for its motors to work against wanted, got {arm.name}: without masses, or "
            "gravity in its plane, work is free; energy=False leaves it out"
        )
