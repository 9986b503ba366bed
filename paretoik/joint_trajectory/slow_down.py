"""Slowing down: the fewest periods of a controller in which a motion keeps its limits.

Slowed down by k, velocities are 1/k, accelerations 1/k² and jerks 1/k³ of what they were, those of the curve exactly,
differences of samples nearly: so the answer is guessed, and then found by bisection among whole periods.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from paretoik.joint_trajectory.limit_check import LimitUse
from paretoik.joint_trajectory.options import OPTIONS
from paretoik.joint_trajectory.time_scaling import TimeScaling

ORDERS = {"velocity": 1, "acceleration": 2, "jerk": 3, "torque": 2, "torque rate": 3}


def slowing(use: LimitUse) -> float:
    """Return about how many times slower the motion must be to use all of a limit, and no more."""
    return use.use ** (1 / ORDERS[use.quantity])


def slow_down(scaling: TimeScaling, measure: Callable[[TimeScaling], list[LimitUse]]) -> TimeScaling | None:
    """Return a scaling of the fewest periods, no fewer than ``scaling`` has, that keeps limits; None if there is none.

    ``measure`` gives the uses of limits. Positions are no matter of time: they are not looked at.
    """
    fails, passes, smallest = scaling.periods - 1, scaling.periods, 1.0
    while True:
        exceeded = [use for use in measure(replace(scaling, periods=passes)) if use.quantity in ORDERS and use.exceeded]
        if not exceeded:
            break
        fails = passes
        factor = max(map(slowing, exceeded))
        passes = max(passes + 1, math.ceil(passes * min(max(factor, smallest), 2.0)))
        smallest += 0.1  # guesses that creep are no better than a search
        if passes > OPTIONS.slowest * scaling.periods:
            return None
    while passes - fails > 1:
        middle = (passes + fails) // 2
        if any(use.exceeded for use in measure(replace(scaling, periods=middle)) if use.quantity in ORDERS):
            fails = middle
        else:
            passes = middle
    return replace(scaling, periods=passes)
