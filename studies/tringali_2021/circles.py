"""Trajectory 2 along other circles: which of them has the printed speeds and energy of least squares."""

from __future__ import annotations

from itertools import product

import numpy as np

import paretoik as pk
from problems.tringali_2021 import DURATION, RADIUS, SAMPLES, START, begin
from studies.reporting import Row
from studies.tringali_2021.trajectories import arm_of, paper

CENTERS = tuple(range(120, 241, 5))  # degrees, from the start; 180 is toward the base, others are out of reach
PLACES = (("Section 3.2", "joint 1 LSV"), ("Section 3.2", "joint 3 LSV"), ("Table 5", "LSV"))


def circle_differences(masses: str, center: float, turns: int, *, samples: int = SAMPLES) -> np.ndarray:
    """Return the relative errors of the numbers at ``PLACES`` (2, places) along another circle.

    ``center`` [degrees] is the direction of the circle's centre from the start. The first row has the greatest forward
    speeds, the second those either way.
    """
    direction = np.radians(center)
    middle = begin() + RADIUS * np.array([np.cos(direction), np.sin(direction)])
    path = pk.circle(middle, RADIUS, duration=DURATION, samples=samples, start_angle=direction + np.pi, turns=turns)
    motion = pk.resolve(arm_of(masses), path, pk.methods.LeastSquaresVelocity(), start=START, unreachable="track")
    speeds, energy = motion.dq[:, [0, 2]], float(pk.kinetic_energy(motion))
    ours = np.array([[*speeds.max(axis=0), energy], [*np.abs(speeds).max(axis=0), energy]])
    return np.asarray(ours / [paper()[table, "trajectory 2", column] for table, column in PLACES] - 1)


def circle_row(masses: str, *, centers: tuple[int, ...] = CENTERS, samples: int = SAMPLES) -> Row:
    """Return the circle nearest to print by its largest error."""
    tried = {
        (center, turns): 100 * circle_differences(masses, center, turns, samples=samples)
        for center, turns in product(centers, (1, -1))
    }
    (center, turns), off = min(tried.items(), key=lambda item: np.abs(item[1]).max(axis=1).min())
    either_way = int(np.abs(off).max(axis=1).argmin())
    farthest = np.abs(off).max(axis=1).min()
    joint_1, joint_3, energy = off[either_way]
    return Row(
        table=f"trajectory 2 along other circles, {masses} masses",
        row=f"nearest of {len(tried)}",
        column="LSV, farthest of three",
        unit="%",
        ours=float(farthest),
        note=f"centre at {center}° from the start, {'this' if turns == 1 else 'the other'} way round, speeds "
        f"{'either way' if either_way else 'forward'}: joint 1 {joint_1:+.1f}, joint 3 {joint_3:+.1f}, "
        f"energy {energy:+.1f} %",
    )
