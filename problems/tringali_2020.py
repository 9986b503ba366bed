"""Tringali & Cocuzza 2020: the five simulations of section 3.2, and the trade-off of section 4.3.

The arm is that of Table 1, as printed. Every problem is a function without arguments, so that only the one in use is
built::

    paretoik solve problems/tringali_2020.py:energy_torque --out runs/first
"""

from __future__ import annotations

import numpy as np

from paretoik import Limits, Path, Tracking, arms, circle, kinetic_energy, line, torque_norm

START = (0.4678, 0.0)
END = (0.0983, 0.1526)
RADIUS = 0.05
POSITION = np.deg2rad([90.0, 120.0, 120.0])  # Table 2
VELOCITY = 3.8
TORQUE = 0.4
POWER = 0.7


def straight(samples: int = 101, *, length: float | None = None) -> Path:
    """Return the straight path of 1 s between the printed ends, or of a ``length`` in that direction [m].

    The printed ends are 0.39977 m apart; the text says 0.40 m.
    """
    displacement = np.subtract(END, START)
    end = END if length is None else START + length * displacement / np.linalg.norm(displacement)
    return line(START, end, duration=1.0, samples=samples)


def round_trip(samples: int = 101) -> Path:
    """Return the circular path, whose centre is between the common start and the base."""
    return circle((START[0] - RADIUS, START[1]), RADIUS, duration=1.0, samples=samples)


def simulation_1() -> Tracking:
    """Least kinetic energy along the line, without limits."""
    return Tracking(arms.tringali_3r(), straight(), objectives=[kinetic_energy], differences="backward")


def simulation_2() -> Tracking:
    """Least kinetic energy along the line, joint positions and velocities limited."""
    limits = Limits(position=POSITION, velocity=VELOCITY)
    return Tracking(arms.tringali_3r(), straight(), objectives=[kinetic_energy], limits=limits, differences="backward")


def simulation_3() -> Tracking:
    """Least torque norm along the line, joint positions and velocities limited."""
    limits = Limits(position=POSITION, velocity=VELOCITY)
    return Tracking(arms.tringali_3r(), straight(), objectives=[torque_norm], limits=limits, differences="backward")


def simulation_4() -> Tracking:
    """Least torque norm along the line, positions, velocities, torques and powers limited."""
    limits = Limits(position=POSITION, velocity=VELOCITY, torque=TORQUE, power=POWER)
    return Tracking(arms.tringali_3r(), straight(), objectives=[torque_norm], limits=limits, differences="backward")


def simulation_5() -> Tracking:
    """Least kinetic energy around the circle, closed, joint positions and velocities limited."""
    limits = Limits(position=POSITION, velocity=VELOCITY)
    return Tracking(
        arms.tringali_3r(),
        round_trip(),
        objectives=[kinetic_energy],
        limits=limits,
        cyclic=True,
        differences="backward",
    )


def energy_torque() -> Tracking:
    """Kinetic energy against torque norm along the line, joint positions and velocities limited."""
    limits = Limits(position=POSITION, velocity=VELOCITY)
    return Tracking(
        arms.tringali_3r(), straight(), objectives=[kinetic_energy, torque_norm], limits=limits, differences="backward"
    )
