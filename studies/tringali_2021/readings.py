"""Other possible readings of the paper: looking ahead by each, compared with Table 5.

The greatest joint speeds of the text agree, and so do the energies along trajectories 1 and 4. The energies along
trajectories 2 and 3 do not. Each reading changes one thing, and is judged by all four energies and all speeds. (A mean
instead of the sum of Eq. 4 changes nothing: its minima are the same.)
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.interpolate import CubicSpline

import paretoik as pk
from paretoik.resolution.predictive import (
    DEGREE,
    HorizonSolution,
    HorizonSolver,
    MakeSolver,
    MakeSpline,
    follow_predictively,
    horizon_program,
    quartic_spline,
)
from paretoik.resolution.protocol import TRACKING_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from problems import tringali_2021
from problems.tringali_2021 import DURATION, RADIUS, SAMPLES, START, begin
from studies.reporting import Row
from studies.tringali_2021.real_time import Slsqp
from studies.tringali_2021.trajectories import NUMBERS, arm_of, paper, text_number

STEP = 1.0  # s: the paper's ΔT


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One other reading of the paper: the method's numbers, its solver, spline or samples."""

    name: str
    method: pk.methods.PredictiveKineticEnergy = field(default_factory=pk.methods.PredictiveKineticEnergy)
    make_solver: MakeSolver = horizon_program
    make_spline: MakeSpline = quartic_spline
    samples: int = SAMPLES

    def resolve(self, number: int, masses: str) -> pk.Motion:
        """Return the motion along a trajectory."""
        task = tringali_2021.problem(number, arm_of(masses), self.samples).task
        return follow_predictively(
            task,
            self.method,
            np.array(START),
            tolerance=TRACKING_TOLERANCE,
            make_solver=self.make_solver,
            make_spline=self.make_spline,
        )


@dataclass(kw_only=True)
class FirstUpdates:
    """Solves the first windows only: the motion ends with the last prediction."""

    solver: HorizonSolver
    updates: int

    def solve(self, q: np.ndarray, posture: np.ndarray, velocity: np.ndarray, targets: np.ndarray) -> HorizonSolution:
        """Return the minimum from positions ahead, for the first windows."""
        self.updates -= 1
        solution = self.solver.solve(q, posture, velocity, targets)
        return solution if self.updates >= 0 else replace(solution, converged=False)


def first_updates(updates: int) -> MakeSolver:
    """Return a function that makes a solver of the first windows."""
    return lambda *arguments: FirstUpdates(solver=horizon_program(*arguments), updates=updates)


def slsqp(*, held: bool = False, precision: float = 1e-12, bound: float = np.inf) -> MakeSolver:
    """Return a function that makes SLSQP on the energy [J s] itself, like fmincon, instead of on a scaled one."""
    return lambda *arguments: Slsqp(
        program=horizon_program(*arguments), exact=True, scaled=False, held=held, precision=precision, bound=bound
    )


def other_masses(masses: str) -> MakeSolver:
    """Return a function that makes windows of the arm with other masses."""

    def make(task: MotionTask, objective: Objective, horizon: int, interval: float, terminal: float) -> HorizonSolver:
        return horizon_program(replace(task, arm=arm_of(masses)), objective, horizon, interval, terminal)

    return make


def last_sample(weight: float) -> MakeSolver:
    """Return a function that makes windows with a weight of the last sample."""

    def make(task: MotionTask, objective: Objective, horizon: int, interval: float, _: float) -> HorizonSolver:
        return horizon_program(task, objective, horizon, interval, weight - 1.0)

    return make


def inertia_earlier(share: float) -> pk.methods.PredictiveKineticEnergy:
    """Return the method with the inertia matrix of an earlier posture, by a share of ΔT."""

    @pk.objective(unit="J s", form="integral")
    def kinetic_energy(motion: pk.Motion) -> np.ndarray:
        return replace(motion, q=motion.q - share * STEP * motion.dq).kinetic_energy

    return pk.methods.PredictiveKineticEnergy(objective=kinetic_energy)


def straight_pieces(points: np.ndarray, rate: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return straight pieces through points, in the form of ``quartic_spline``."""
    coefficients = np.zeros((len(points) - 1, DEGREE + 1, points.shape[1]))
    coefficients[:, 0], coefficients[:, 1] = points[:-1], np.diff(points, axis=0)
    return coefficients


def cubic_spline(points: np.ndarray, rate: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return a cubic spline ("4th order" as Matlab counts) with velocities at both ends, accelerations at none."""
    spline = CubicSpline(np.arange(len(points)), points, bc_type=((1, rate), (1, np.zeros_like(rate))))
    return np.concatenate([spline.c[::-1], np.zeros((1, *spline.c.shape[1:]))]).swapaxes(0, 1)


def without_acceleration(points: np.ndarray, rate: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the quartic spline that begins with no acceleration."""
    return quartic_spline(points, rate, np.zeros_like(second))


predictive = pk.methods.PredictiveKineticEnergy
READINGS = (  # the first few, which come near, are the quick study's
    Reading(name="as read"),
    Reading(name="SLSQP on the energy itself, from the posture held", make_solver=slsqp(held=True)),
    Reading(name="tracking error fed back, 10 1/s", method=predictive(feedback=10.0)),
    Reading(name="the last update 4 s before the end", make_solver=first_updates(13)),
    Reading(name="straight pieces instead of a spline", make_spline=straight_pieces),
    Reading(name="SLSQP on the energy itself, stopped at 1e-7 J s", make_solver=slsqp(held=True, precision=1e-7)),
    Reading(name="joint positions within ±π in the windows", make_solver=slsqp(bound=np.pi)),
    Reading(name="windows with the masses as printed", make_solver=other_masses("printed")),
    Reading(name="windows summed by trapezoids", make_solver=last_sample(0.5)),
    Reading(name="M at the middle of ΔT", method=inertia_earlier(0.5)),
    Reading(name="M at the beginning of ΔT", method=inertia_earlier(1.0)),
    Reading(name="the last update 3 s before the end", make_solver=first_updates(15)),
    Reading(name="cubic spline, velocities at both ends", make_spline=cubic_spline),
    Reading(name="acceleration 0 at every update", make_spline=without_acceleration),
    Reading(name="Δt = 0.005 s", samples=2 * SAMPLES - 1),
    Reading(name="Δt = 0.02 s", samples=(SAMPLES + 1) // 2),
    Reading(name="updates every 0.25 s", method=predictive(update_interval=0.25)),
    Reading(name="updates every 0.8 s", method=predictive(update_interval=0.8)),
    Reading(name="updates every 1 s", method=predictive(update_interval=1.0)),
    Reading(name="ΔT = 0.8 s", method=predictive(prediction_step=0.8, update_interval=0.5)),
    Reading(name="four samples ahead, ΔT = 0.5 s", method=predictive(horizon=4, update_interval=0.5)),
)


def reading_row(name: str, masses: str, *, numbers: tuple[int, ...] = NUMBERS) -> Row:
    """Return the largest energy error of a reading against Table 5; by name so that it can run in another process."""
    reading = next(each for each in READINGS if each.name == name)
    motions = {f"trajectory {number}": reading.resolve(number, masses) for number in numbers}
    energies = {name: float(pk.kinetic_energy(motion)) for name, motion in motions.items()}
    off = {name: 100 * (energy / paper()["Table 5", name, "PMKE"] - 1) for name, energy in energies.items()}
    others: dict[str, list[str]] = {name: [] for name in motions}
    for (table, name, column), printed in paper().items():
        if name in motions and column.endswith("PMKE") and table != "Table 5":
            others[name].append(f"{100 * (text_number(motions[name], table, name, column) / printed - 1):+.1f}")
    note = (
        f"energies along trajectories {', '.join(name[-1] for name in off)}: "
        f"{', '.join(f'{value:+.1f}' for value in off.values())} %; "
        f"what the text says of them: {'; '.join(', '.join(each) for each in others.values())} %"
    )
    title = f"looking ahead by other readings of the paper, {masses} masses"
    return Row(title, reading.name, "farthest from Table 5", "%", max(off.values(), key=abs), note=note)


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
    note = (
        f"centre at {center}° from the start, {'this' if turns == 1 else 'the other'} way round, speeds "
        f"{'either way' if either_way else 'forward'}: joint 1 {joint_1:+.1f}, joint 3 {joint_3:+.1f}, "
        f"energy {energy:+.1f} %"
    )
    table = f"trajectory 2 along other circles, {masses} masses"
    return Row(table, f"nearest of {len(tried)}", "LSV, farthest of three", "%", float(farthest), note=note)
