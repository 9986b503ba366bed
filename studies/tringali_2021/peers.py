"""One window, two samples ahead, by CasADi: its SQP with qrqp, and FATROP, each with exact second derivatives.

They get optimal control in lean closed form: positions are the state, the velocity ahead is the control, which suits
FATROP and is quicker for the SQP than positions only. All begin where ours does, at every update along the four
trajectories; only the solver's call is timed.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi
import numpy as np
from casadi import SX, cos, cumsum, dot, sin, vertcat

import paretoik as pk
from paretoik.resolution.predictive import HorizonProgram, HorizonSolution, follow_predictively, horizon_program
from paretoik.resolution.protocol import TRACKING_TOLERANCE
from problems import tringali_2021
from problems.tringali_2021 import LENGTHS, START
from studies.reporting import Row
from studies.tringali_2021.trajectories import NUMBERS, arm_of

SAME = 1e-6  # relative: energies of the same minimum
QUIET: dict[str, Any] = {"print_time": False, "error_on_fail": False}
SQP = {
    **QUIET,
    "qpsol": "qrqp",
    "qpsol_options": {"print_iter": False, "print_header": False, "error_on_fail": False},
    "print_header": False,
    "print_iteration": False,
    "print_status": False,
    "tol_du": 1e-9,
    "tol_pr": 1e-12,
    "min_step_size": 0.0,
}
FATROP = {**QUIET, "structure_detection": "auto", "fatrop": {"print_level": 0, "tolerance": 1e-9}}


class Window(NamedTuple):
    """The data of an update: first positions (horizon, dof), posture, velocity, targets; and our result."""

    q: np.ndarray
    posture: np.ndarray
    velocity: np.ndarray
    targets: np.ndarray
    solution: HorizonSolution


@dataclass(frozen=True, kw_only=True, eq=False)
class Recorder:
    """Solves like a program, and keeps its windows."""

    program: HorizonProgram
    windows: list[Window]

    def solve(self, q: np.ndarray, posture: np.ndarray, velocity: np.ndarray, targets: np.ndarray) -> HorizonSolution:
        """Return the minimum from positions ahead."""
        solution = self.program.solve(q, posture, velocity, targets)
        self.windows.append(Window(q.copy(), posture.copy(), velocity.copy(), targets, solution))
        return solution


def recorded_windows(masses: str, *, numbers: tuple[int, ...] = NUMBERS) -> tuple[HorizonProgram, list[Window]]:
    """Return the program of a window, and all windows of the paper's schedule along the trajectories."""
    windows = list[Window]()
    for number in numbers:
        task = tringali_2021.problem(number, arm_of(masses)).task
        follow_predictively(
            task,
            pk.methods.PredictiveKineticEnergy(),
            np.array(START),
            tolerance=TRACKING_TOLERANCE,
            make_solver=lambda *arguments: Recorder(program=horizon_program(*arguments), windows=windows),
        )
    return horizon_program(task, pk.kinetic_energy, 2, 1.0), windows


def kinetic_energy(arm: pk.Arm, q: Any, dq: Any) -> Any:
    """Return the kinetic energy of a planar arm, link by link."""
    angle, rate = cumsum(q), cumsum(dq)
    total, x, y = SX(0), SX(0), SX(0)  # velocity of the joint
    for i, (body, length) in enumerate(zip(arm.bodies, LENGTHS, strict=True)):
        center = float(body.center[0])
        vx, vy = x - center * sin(angle[i]) * rate[i], y + center * cos(angle[i]) * rate[i]
        total += (body.mass * (vx**2 + vy**2) + float(body.inertia[2, 2]) * rate[i] ** 2) / 2
        x, y = x - length * sin(angle[i]) * rate[i], y + length * cos(angle[i]) * rate[i]
    return total


def tool(q: Any) -> Any:
    """Return the tool's position."""
    angle = cumsum(q)
    return vertcat(dot(np.array(LENGTHS), cos(angle)), dot(np.array(LENGTHS), sin(angle)))


def optimal_control(arm: pk.Arm, horizon: int, interval: float) -> dict[str, Any]:
    """Return the window's program: of each stage the positions, except the first, and the velocity ahead."""
    posture, q = SX.sym("posture", 3), [SX.sym(f"q{k}", 3) for k in range(horizon)]
    targets, dq = [SX.sym(f"x{k}", 2) for k in range(horizon)], [SX.sym(f"dq{k}", 3) for k in range(horizon)]
    energy, rows, unknowns = SX(0), list[Any](), list[Any]()
    for k in range(horizon):
        here = q[k - 1] if k else posture
        energy += interval * kinetic_energy(arm, here + interval * dq[k], dq[k])
        rows += [q[k] - here - interval * dq[k], *([tool(here) - targets[k - 1]] if k else [])]
        unknowns += [dq[k], q[k]]
    rows.append(tool(q[-1]) - targets[-1])
    return {"x": vertcat(*unknowns), "p": vertcat(posture, *targets), "f": energy, "g": vertcat(*rows)}


def window_rows(masses: str, *, rounds: int, numbers: tuple[int, ...] = NUMBERS) -> list[Row]:
    """Return the milliseconds of a window by ours and the peers, alternating, and the number of equal minima."""
    program, windows = recorded_windows(masses, numbers=numbers)
    interval = program.interval
    problem = optimal_control(arm_of(masses), program.horizon, interval)
    fatrop = {**FATROP, "equality": [True] * problem["g"].numel()}
    peers = {
        "SQP with qrqp, CasADi": casadi.nlpsol("sqp", "sqpmethod", problem, SQP),
        "FATROP, CasADi": casadi.nlpsol("fatrop", "fatrop", problem, fatrop),
    }
    solvers = {"ours": None, **peers}
    seconds: dict[str, list[float]] = {name: [] for name in solvers}
    values: dict[str, list[float]] = {name: [] for name in solvers}
    for turn in range(1 + rounds):  # the first is not timed
        for window in windows:
            # the unknowns of ``optimal_control`` at our start
            rates = np.diff(window.q, axis=0, prepend=window.posture[None]) / interval
            x0 = casadi.DM(np.stack([rates, window.q], axis=1).ravel())
            p = casadi.DM(np.concatenate([window.posture, window.targets[:, :2].ravel()]))
            for name, solver in solvers.items():
                begin = time.perf_counter()
                if solver is None:
                    value = program.solve(window.q, window.posture, window.velocity, window.targets).value
                else:
                    value = float(solver(x0=x0, p=p, lbg=0.0, ubg=0.0)["f"])
                elapsed = time.perf_counter() - begin
                if turn:
                    seconds[name].append(elapsed)
                else:
                    values[name].append(value)
    ours = float(np.median(seconds["ours"]))
    lowest = np.array([window.solution.value for window in windows])
    rows = []
    for name, spent in seconds.items():
        same = int((np.abs(np.array(values[name]) / lowest - 1) < SAME).sum())
        middle = float(np.median(spent))
        note = f"{middle / ours:.2f} times ours; the same minimum in {same} of {len(windows)}; "
        note += f"99 % within {1e3 * np.quantile(spent, 0.99):.3f} ms"
        place, reference = f"{len(windows)} windows, {masses} masses", None if name == "ours" else 1e3 * ours
        table = "a window of two samples, median"
        rows.append(Row(table, place, name, "ms", 1e3 * middle, reference=reference, source="ours", note=note))
    return rows
