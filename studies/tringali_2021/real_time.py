"""Time of an update: ours, and the same window by SciPy's SLSQP, alternating in one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

import paretoik as pk
from paretoik.resolution.predictive import (
    HorizonProgram,
    HorizonSolution,
    MakeSolver,
    PredictiveTraces,
    follow_predictively,
    horizon_program,
)
from paretoik.resolution.protocol import TRACKING_TOLERANCE
from paretoik.task.motion_task import MotionTask
from problems import tringali_2021
from problems.tringali_2021 import START
from studies.reporting import Row
from studies.tringali_2021.trajectories import NUMBERS, arm_of, paper

GOAL, TIMES = 5e-4, 10.0  # s, median; times as fast as SLSQP with differences
SAME = 1e-6  # relative: energies of the same motion


@dataclass(frozen=True, kw_only=True, eq=False)
class Slsqp:
    """The same program for SciPy's SLSQP, with derivatives by differences or with ours.

    ``scaled`` divides the energy by that at the start, else it is in J s; ``held`` starts from the current posture at
    all samples; ``precision`` of the energy is SLSQP's, and ``bound`` [rad] limits joint positions either way.
    """

    program: HorizonProgram
    exact: bool
    scaled: bool = True
    held: bool = False
    precision: float = 1e-12
    bound: float = np.inf

    def solve(self, q: np.ndarray, posture: np.ndarray, velocity: np.ndarray, targets: np.ndarray) -> HorizonSolution:
        """Return SLSQP's result from positions ahead."""
        size, count, program = q.size, self.program.horizon * self.program.rows, self.program
        start = np.clip(np.broadcast_to(posture, q.shape) if self.held else q, -self.bound, self.bound).ravel()
        fixed = program.inputs(q, posture, velocity, targets)[size:, 0]

        def at(z: np.ndarray) -> np.ndarray:
            return np.asarray(program.derivatives(np.concatenate([z, fixed])[:, None])[:, 0])

        def jacobian(z: np.ndarray) -> np.ndarray:
            blocks = at(z)[1 + size + count :].reshape(program.horizon, program.rows, program.dof)
            jacobian_matrix = np.zeros((program.horizon, program.rows, program.horizon, program.dof))
            jacobian_matrix[np.arange(program.horizon), :, np.arange(program.horizon)] = blocks
            return jacobian_matrix.reshape(count, size)

        scale = max(float(at(start)[0]), 1e-12) if self.scaled else 1.0
        result = minimize(
            lambda z: at(z)[0] / scale,
            start,
            jac=(lambda z: at(z)[1 : 1 + size] / scale) if self.exact else None,
            method="SLSQP",
            constraints={
                "type": "eq",
                "fun": lambda z: at(z)[1 + size : 1 + size + count],
                **({"jac": jacobian} if self.exact else {}),
            },
            bounds=[(-self.bound, self.bound)] * size,
            options={"ftol": self.precision, "maxiter": 200},
        )
        return HorizonSolution(
            q=result.x.reshape(q.shape), value=result.fun * scale, converged=bool(result.success), iterations=result.nit
        )


def real_time_rows(*, rounds: int) -> list[Row]:
    """Return the seconds of an update over all trajectories, spline included: their distribution, and SLSQP's."""
    solvers: dict[str, MakeSolver] = {
        "ours": horizon_program,
        "SLSQP, differences": lambda *arguments: Slsqp(program=horizon_program(*arguments), exact=False),
        "SLSQP, exact derivatives": lambda *arguments: Slsqp(program=horizon_program(*arguments), exact=True),
    }
    seconds: dict[str, list[np.ndarray]] = {solver: [] for solver in solvers}
    energies: dict[str, list[float]] = {solver: [] for solver in solvers}
    tasks: list[MotionTask] = [tringali_2021.problem(number, arm_of("fitted")).task for number in NUMBERS]
    for task in tasks[:1]:
        follow_predictively(
            task, pk.methods.PredictiveKineticEnergy(), np.array(START), tolerance=TRACKING_TOLERANCE
        )  # compiled once
    for turn in range(rounds):
        for task in tasks:
            for solver, make in solvers.items():
                arguments = task, pk.methods.PredictiveKineticEnergy(), np.array(START)
                motion = follow_predictively(*arguments, tolerance=TRACKING_TOLERANCE, make_solver=make)
                assert isinstance(motion.traces, PredictiveTraces)
                seconds[solver].append(motion.traces.seconds)
                if turn == 0:
                    energies[solver].append(float(pk.kinetic_energy(motion)))
    rows = []
    ours = float(np.median(np.concatenate(seconds["ours"])))
    for solver in solvers:
        elapsed = np.concatenate(seconds[solver])
        low, middle, high, last = np.quantile(elapsed, [0.25, 0.5, 0.75, 0.99])
        difference = max(abs(a / b - 1) for a, b in zip(energies[solver], energies["ours"], strict=True))
        notes = [f"quartiles {1e3 * low:.2f} and {1e3 * high:.2f} ms, 99 % within {1e3 * last:.2f} ms"]
        if solver == "ours":
            prefix = "LOSS: " if middle > GOAL else ""
            notes.append(f"{prefix}goal {1e3 * GOAL:g} ms; {len(elapsed)} updates; the paper's in C and Matlab")
        else:
            goal = TIMES if "differences" in solver else None
            prefix = "LOSS: " if goal is not None and middle / ours < goal else ""
            notes.append(f"{prefix}{middle / ours:.1f} times ours" + (f", goal {goal:g}" if goal else ""))
            notes.append(f"energies {'the same' if difference < SAME else 'apart'}, within {difference:.1e}")
        reference = 1e3 * paper()["Section 3.2", "an update", "seconds"]
        table = "an update, optimisation and spline, median"
        row = "four trajectories, fitted masses"
        rows.append(Row(table, row, solver, "ms", 1e3 * middle, reference=reference, note="; ".join(notes)))
    return rows
