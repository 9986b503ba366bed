"""Kim, Choi & Jang 2021: a planar arm driven at its joints (JAM) or by sliders along its links (DAM), under gravity.

The paper finds the highest speed in each direction, and the least time, one by one. Here they are trade-offs:
directions, power and force against each other in one posture, time against energy from point to point. Masses, the
base's angle and the way joints bend are assumptions, since the paper does not print them (``kim_3r``, ``kim_sliders``).
"""

from __future__ import annotations

from paretoik import DirectionalMaxima, PointToPoint, arms, capability

PLACE = (0.2, -0.15)  # m, Figure 5
START, TARGET = (0.1, -0.15), (0.2, -0.15)  # m, positions 4 and 6, read off the grid of Figure 6
WAYS = ((1.0, 0.0), (0.0, 1.0))


def directions_jam() -> DirectionalMaxima:
    """Speed ahead, speed upwards and power in one posture, motors at the joints."""
    return DirectionalMaxima(arms.kim_3r(), capability.kim_joint_motors(), PLACE, WAYS)


def directions_dam() -> DirectionalMaxima:
    """Speed ahead, speed upwards and power in one posture, sliders along the links."""
    return DirectionalMaxima(arms.kim_3r(), capability.kim_sliders(), PLACE, WAYS)


def speed_force_dam() -> DirectionalMaxima:
    """Speed upwards against force upwards in one posture, sliders along the links: gears that are fast are weak."""
    ways = (WAYS[1], WAYS[1])
    return DirectionalMaxima(
        arms.kim_3r(), capability.kim_sliders(), PLACE, ways, quantity=("velocity", "force"), power=False
    )


def point_to_point_jam() -> PointToPoint:
    """Time against energy from position 4 to position 6, motors at the joints."""
    return PointToPoint(arms.kim_3r(), capability.kim_joint_motors(), START, TARGET)


def point_to_point_dam() -> PointToPoint:
    """Time against energy from position 4 to position 6, sliders along the links."""
    return PointToPoint(arms.kim_3r(), capability.kim_sliders(), START, TARGET)
