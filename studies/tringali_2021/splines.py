"""Looking three or more samples ahead: the choice of a quartic spline through them.

With two pieces, the paper's, positions, velocities and accelerations at both ends and C² at the knot determine it.
Every further piece leaves one free number per joint: the library takes the least jerk. Splines of degree four are
usually C³, which is possible here at all knots but one: all but the first ("later knots"), or all but the last
("earlier").
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from math import factorial

import numpy as np
from jaxtyping import Float
from scipy.interpolate import make_interp_spline

import paretoik as pk
from paretoik.resolution.predictive import DEGREE, follow_predictively, quartic_spline
from paretoik.resolution.protocol import TRACKING_TOLERANCE
from paretoik.runs.distribution import Executor
from problems import tringali_2021
from problems.tringali_2021 import START
from studies.processes import run_each
from studies.reporting import Row
from studies.tringali_2021.trajectories import NUMBERS, arm_of

AHEAD = (3, 4, 5, 6)
STEPS = (1.0, 0.4)  # s: the paper's ΔT, and one with which these samples are nearer to its 2 s


def thrice_continuous(
    points: Float[np.ndarray, "points dof"],
    rate: Float[np.ndarray, " dof"],
    second: Float[np.ndarray, " dof"],
    *,
    twice: int,
) -> Float[np.ndarray, "pieces 5 dof"]:
    """Return coefficients as ``quartic_spline`` does, C³ at all inner points except index ``twice``, C² there."""
    pieces, still = len(points) - 1, np.zeros_like(rate)
    times = np.arange(pieces + 1.0)
    inner = np.sort(np.append(times[1:-1], times[1:-1][twice]))  # a less smooth knot is repeated
    knots = np.concatenate([np.zeros(DEGREE + 1), inner, np.full(DEGREE + 1, float(pieces))])
    ends = [(1, rate), (2, second)], [(1, still), (2, still)]
    spline = make_interp_spline(times, points, k=DEGREE, t=knots, bc_type=ends)
    return np.stack([spline(times[:-1], nu=order) / factorial(order) for order in range(DEGREE + 1)], axis=1)


SPLINES: dict[str, Callable[..., np.ndarray]] = {
    "least jerk": quartic_spline,
    "C³ at later knots": partial(thrice_continuous, twice=0),
    "C³ at earlier knots": partial(thrice_continuous, twice=-1),
}


def spline_energies(
    number: int, masses: str, *, ahead: tuple[int, ...], samples: int = tringali_2021.SAMPLES
) -> Float[np.ndarray, "settings splines"]:
    """Return kinetic energies [J s] along a trajectory, for all samples ``ahead`` and ``STEPS``, by every spline."""
    task = tringali_2021.problem(number, arm_of(masses), samples).task

    def energy(horizon: int, step: float, spline: Callable[..., np.ndarray]) -> float:
        method = pk.methods.PredictiveKineticEnergy(horizon=horizon, prediction_step=step, update_interval=0.5)
        follow = partial(follow_predictively, task, method, np.array(START), tolerance=TRACKING_TOLERANCE)
        return float(pk.kinetic_energy(follow(make_spline=spline)))

    return np.array([[energy(*setting, spline) for spline in SPLINES.values()] for setting in product(ahead, STEPS)])


def spline_rows(
    masses: str, *, numbers: tuple[int, ...] = NUMBERS, ahead: tuple[int, ...] = AHEAD, executor: Executor | None = None
) -> list[Row]:
    """Return how far each spline's energy is above the best of the three, along each trajectory and all of them."""
    calls = {(f"trajectory {number}",): partial(spline_energies, number, masses, ahead=ahead) for number in numbers}
    above = {
        name: 100 * (energies / energies.min(axis=1, keepdims=True) - 1)
        for (name,), energies in run_each(executor, calls).items()
    }
    above["all"] = np.concatenate(list(above.values()))
    settings = f"h = {', '.join(map(str, ahead))}, each with ΔT = {' and '.join(f'{step:g} s' for step in STEPS)}"
    choice = "; the library's: its worst is the least" if above["all"].max(axis=0).argmin() == 0 else ""
    rows = []
    for row, values in above.items():
        for k, name in enumerate(SPLINES):
            column = values[:, k]
            note = f"the worst; median {np.median(column):.2f}, mean {column.mean():.2f}"
            note += f"; {settings}" if row == "all" else f": {', '.join(f'{value:.2f}' for value in column)}"
            note += choice if row == "all" and k == 0 else ""
            what = f"energy above the best spline's, {name}"
            rows.append(Row(f"looking farther ahead, {masses} masses", row, what, "%", float(column.max()), note=note))
    return rows
