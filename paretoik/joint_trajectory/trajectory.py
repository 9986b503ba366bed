"""A joint trajectory: one motion as samples at a controller's rate, for a file or a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_number, positive_number, shown
from paretoik.joint_trajectory.controllers import OPTIONS, check_joint_names
from paretoik.tables import html_representation
from paretoik.task.motion import Motion

# Time scalings: the same curve in its own time, slower, or from rest to rest.
#
# Lynch & Park, Modern Robotics, chapter 9: with q(σ(t)) velocities are q' σ̇ and accelerations q'' σ̇² + q' σ̈.


@dataclass(frozen=True, kw_only=True)
class TimeScaling:
    """A motion of ``duration`` [s], spread over ``periods`` of a controller of ``rate`` [Hz].

    With a ``ramp`` [s of the motion's own speed] it starts from rest and comes to rest: σ̇ rises from 0 to its full
    value by 10x³ − 15x⁴ + 6x⁵, the minimum-jerk law, and falls in the same way, so that velocity, acceleration and jerk
    of the scaling are 0 at both ends. Each ramp takes the time ``ramp`` and covers half of it.
    """

    duration: float
    periods: int
    rate: float
    ramp: float = 0.0

    @property
    def factor(self) -> float:
        """Factor by which the motion is slower than at its own speed, without its ramps."""
        return self.periods / (self.rate * (self.duration + self.ramp))

    def times(self, rate: float | None = None) -> Times:
        """Return times of samples [s] in whole nanoseconds, as ROS keeps them, at its own or another rate."""
        rate = self.rate if rate is None else rate
        return np.rint(np.arange(math.ceil(self._periods(rate)) + 1) * (1e9 / rate)) / 1e9

    def evaluate(self, rate: float | None = None) -> Float[np.ndarray, "3 time"]:
        """Return σ [s], σ̇ and σ̈ [1/s] at the samples; σ runs from exactly 0 to exactly the duration.

        At another ``rate`` the last sample may be less than a period after the end; its values are those of the end.
        """
        total = self.duration + self.ramp
        periods = self._periods(self.rate if rate is None else rate)
        u = np.minimum(np.arange(math.ceil(periods) + 1) / periods, 1.0) * total
        if self.ramp == 0:
            return np.stack([u, np.full_like(u, 1 / self.factor), np.zeros_like(u)])
        from_end = np.minimum(u, total - u)  # to the nearer end: the law is symmetric
        x = np.minimum(from_end / self.ramp, 1.0)
        covered = np.where(from_end < self.ramp, self.ramp * x**4 * (2.5 + x * (x - 3.0)), from_end - self.ramp / 2)
        later = u > total / 2
        sigma = np.where(later, self.duration - covered, covered)
        speed = x**3 * (10.0 + x * (6.0 * x - 15.0))
        bend = 30.0 * (x * (1.0 - x)) ** 2 / self.ramp * np.where(later, -1.0, 1.0)
        return np.stack([sigma, speed / self.factor, bend / self.factor**2])

    def _periods(self, rate: float) -> float:
        """Return its duration in periods of a rate; almost whole numbers are rounded."""
        periods = self.periods * (rate / self.rate)
        return float(round(periods)) if abs(periods - round(periods)) <= OPTIONS.whole * periods else periods


def time_scaling(duration: float, rate: float, *, time_scale: float = 1.0, ramp: float = 0.0) -> TimeScaling:
    """Return the scaling of a motion; ``time_scale`` is rounded up so that it takes whole periods.

    Raises InvalidInput for a time scale below 1, a ramp shorter than a period or longer than the motion, and a
    rate with too few or too many periods.
    """
    scale, ramp = positive_number("time_scale", time_scale, ""), finite_number("ramp", ramp)
    if scale < 1:
        raise InvalidInput(f"time_scale must be 1 or more, to slow down, got {scale:g}; plan a faster motion instead")
    if ramp != 0 and not 1 / rate <= ramp <= duration:
        raise InvalidInput(f"ramp must be 0, or from one period to the motion's {duration:g} s, got {ramp:g} s")
    periods = np.ceil((duration + ramp) * scale * rate - OPTIONS.whole)
    if rate > OPTIONS.rate or not 3 <= periods <= OPTIONS.periods:
        wish = f"at most {OPTIONS.rate:g} Hz, and from 3 to {OPTIONS.periods} periods"
        raise InvalidInput(f"rate and time_scale must give {wish}, got {rate:g} Hz for {(duration + ramp) * scale:g} s")
    return TimeScaling(duration=duration, periods=int(periods), rate=rate, ramp=ramp)


# Joint trajectories, sampled at a controller's rate.


JointSeries = Float[np.ndarray, "time dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class JointTrajectory:
    """Samples of one motion for a controller. Arrays are read-only.

    joint_names: names of the joints, one per column
    time: times (time,) [s] from 0, evenly spaced, in whole nanoseconds
    q, dq, ddq: positions, velocities and accelerations (time, dof) [rad, m; per s; per s²]
    metadata: entries about the motion and its sampling
    """

    joint_names: tuple[str, ...]
    time: Times
    q: JointSeries
    dq: JointSeries
    ddq: JointSeries
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("time", "q", "dq", "ddq"):
            values = np.array(getattr(self, name), dtype=float, order="C")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        return f"JointTrajectory({len(self.time)} samples of {', '.join(self.joint_names)}, {self.time[-1]:g} s)"

    _repr_html_ = html_representation

    def reorder(self, joint_names: Sequence[str]) -> JointTrajectory:
        """Return the trajectory with its columns in the order of ``joint_names``.

        Raises InvalidInput if these are not the same joints.
        """
        names = same_joints(joint_names, self.joint_names)
        order = [self.joint_names.index(joint) for joint in names]
        q, dq, ddq = (values[:, order] for values in (self.q, self.dq, self.ddq))
        return replace(self, joint_names=names, q=q, dq=dq, ddq=ddq)


def same_joints(joint_names: object, joints: Sequence[str]) -> tuple[str, ...]:
    """Return joint names in their order; raises InvalidInput if they are not those of ``joints``, each once."""
    names = check_joint_names("joint_names", joint_names)
    for listed, others, fact in ((names, joints, "got the unknown"), (joints, names, "got no")):
        strange = next((joint for joint in listed if joint not in others), None)
        if strange is not None:
            raise InvalidInput(f"joint_names must be {', '.join(joints)} in any order, {fact} {shown(strange)}")
    return names


def sample_motion(motion: Motion, scaling: TimeScaling, rate: float | None = None) -> JointTrajectory:
    """Return the samples of one motion in scaled time, at the scaling's own rate or at another [Hz].

    Raises Infeasible if the motion leaves its path between its own samples.
    """
    sigma, speed, bend = scaling.evaluate(rate)
    q, by_sigma, curved = motion.state(motion.time[0] + sigma)
    return JointTrajectory(
        joint_names=motion.arm.joint_names,
        time=scaling.times(rate),
        q=q,
        dq=by_sigma * speed[:, None],
        ddq=curved * speed[:, None] ** 2 + by_sigma * bend[:, None],
    )
