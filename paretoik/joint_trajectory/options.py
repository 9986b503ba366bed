"""Tolerances and sizes of trajectories for controllers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class JointTrajectoryOptions:
    """Settings of sampling, checking and slowing down.

    ``rounding`` is the share of a limit by which it may be exceeded. A joint is at rest below a share of its velocity
    limit, ``rest_velocity``, and of its acceleration limit, ``rest_acceleration``, or of the motion's largest value
    where there is no limit: so much cubic splines leave of a law without acceleration at its ends.

    A motion is slowed down at most ``slowest`` times: what exceeds a limit then does so at rest too, as torques of
    gravity do. ``ramps`` [s] are tried in turn to say which is enough; ``usual_ramp`` [s] is advised where none is.

    ``rate`` [Hz] is the largest: times in whole nanoseconds still differ. ``periods`` are the most, some gigabytes of
    work; a duration within ``whole`` of a period has whole ones.
    """

    rounding: float = 1e-9
    rest_velocity: float = 1e-3
    rest_acceleration: float = 1e-2
    slowest: float = 30.0
    ramps: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
    usual_ramp: float = 0.2
    rate: float = 1e6
    periods: int = 1_000_000
    whole: float = 1e-9


OPTIONS = JointTrajectoryOptions()
