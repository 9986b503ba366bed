"""The nonlinear program of a motion in stages, for FATROP: states are posture, rate and sums, controls the next rate.

CasADi finds the stages by itself if the variables and rows of each are together, its gap first. Sums are divided by
their ranges; the last ones are the totals, and below ceilings.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import MX, SX, vertcat

from paretoik.task.motion_task import MotionTask
from studies.benchmarks.fronts.programs import (
    CAP,
    TOLERANCE,
    above_power,
    at_sample,
    check,
    compiled_library,
    limited_sides,
    peaks,
    pose_function,
    slacks,
)
from studies.benchmarks.planner.peers import narrow


@dataclass(frozen=True, eq=False)
class Layout:
    """The places of postures, rates and sums, and of the controls, of all stages in x."""

    samples: int
    dof: int
    sums: int
    slacks: int

    @property
    def size(self) -> int:
        """Numbers in x."""
        return self.dof + (self.samples - 1) * self.width

    @property
    def width(self) -> int:
        """Size of a stage; the first has neither rate nor sums, the last has no control."""
        return 3 * self.dof + self.sums + self.slacks

    def posture(self, k: int) -> slice:
        """Return the place of sample k's posture."""
        return self._part(k, 0, self.dof)

    def state(self, k: int) -> slice:
        """Return the place of sample k's posture, rate and sums; the first has a posture only."""
        return self._part(k, 0, 2 * self.dof + self.sums if k else self.dof)

    def control(self, k: int) -> slice:
        """Return the place of the rate to sample k + 1, and of the slack variables there."""
        return self._part(k, 2 * self.dof + self.sums if k else self.dof, self.dof + self.slacks)

    def _part(self, k: int, begin: int, size: int) -> slice:
        begin += 2 * self.dof + self.slacks + (k - 1) * self.width if k else 0
        return slice(begin, begin + size)


@dataclass(frozen=True, eq=False)
class StagedProgram:
    """Solvers for cold and warm starts, a stage's step, and the bounds of the program."""

    task: MotionTask
    layout: Layout
    solvers: dict[bool, Any]
    step: Any
    sides: dict[str, np.ndarray]

    def solve(
        self, q: np.ndarray, main: int, ceilings: np.ndarray, ranges: np.ndarray, *, warm: bool
    ) -> tuple[np.ndarray | None, int]:
        """Return the motion (samples, dof) from a start, None if FATROP does not converge, and the iterations."""
        count = len(ranges)
        upper = self.sides["ubx"].copy()
        upper[-count:] = ceilings / ranges
        lbx, ubx = narrow(self.sides["lbx"], upper)
        lbg, ubg = narrow(self.sides["lbg"], self.sides["ubg"])
        p = np.concatenate([np.where(np.arange(count) == main, 1.0, 0.0), ranges])
        solver = self.solvers[warm]
        solution = solver(x0=self.pack(q, ranges), p=p, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
        stats, x = solver.stats(), np.asarray(solution["x"]).ravel()
        made = np.stack([x[self.layout.posture(k)] for k in range(len(q))])
        return (made if stats["success"] else None), int(stats["iter_count"])

    def pack(self, q: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return x of a motion."""
        rates, x = np.diff(q, axis=0) / _dt(self.task), np.empty(self.layout.size)
        controls = np.concatenate([rates, above_power(self.task, q)[1:]], axis=1)
        x[self.layout.state(0)] = q[0]
        before = np.concatenate([q[0], np.zeros(len(q[0]) + len(ranges))])
        for k, control in enumerate(controls):
            x[self.layout.control(k)] = control
            before = np.asarray(self.step(before, control, ranges)[0]).ravel()
            x[self.layout.state(k + 1)] = before
        return x


def staged_program(task: MotionTask, folder: Path | None = None, name: str = "") -> StagedProgram:
    """Return the program of a task with backward differences, limits only on joints and a free end.

    It is compiled into a folder, under this name, if one is given.
    """
    check(task)
    assert not task.cyclic, "the path must be open, got a cycle"
    assert not peaks(task), "objectives must be sums, got a peak: it would be one more state of every stage"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # our kernels call NumPy's cosine for symbols too
        step, pose = _step(task), pose_function(task)
        layout = Layout(len(task.times), task.arm.dof, len(task.objectives), slacks(task))
        asked, sides, equality = _written(task, layout, step, pose)
    what: Any = asked
    if folder is not None:
        solver = casadi.nlpsol("peer", "fatrop", asked, _options(equality, warm=False))
        what = compiled_library(asked, solver, f"{name}_staged", folder)
    solvers = {warm: casadi.nlpsol("peer", "fatrop", what, _options(equality, warm=warm)) for warm in (False, True)}
    return StagedProgram(task, layout, solvers, step, sides)


def _step(task: MotionTask) -> Any:
    """Return a function of a sample's state, the next control and the ranges: next state and limited values."""
    dof, count, dt = task.arm.dof, len(task.objectives), _dt(task)
    state: Any = SX.sym("state", 2 * dof + count)
    control: Any = SX.sym("control", dof + slacks(task))
    rate, slack = control[:dof], control[dof:]
    ranges: Any = SX.sym("ranges", count)
    q = state[:dof] + dt * rate
    worth, limited = at_sample(task, q, rate, (rate - state[dof : 2 * dof]) / dt, slack)
    return casadi.Function(
        "step", [state, control, ranges], [vertcat(q, rate, state[2 * dof :] + dt * worth / ranges), limited]
    )


def _written(
    task: MotionTask, layout: Layout, step: Any, pose: Any
) -> tuple[dict[str, Any], dict[str, np.ndarray], list[bool]]:
    x: Any = MX.sym("x", layout.size)
    p: Any = MX.sym("p", 2 * layout.sums)
    low, high = limited_sides(task)
    rows: list[Any] = []
    lower: list[np.ndarray] = []
    upper: list[np.ndarray] = []
    equality: list[bool] = []
    for k in range(layout.samples):
        if k < layout.samples - 1:
            state = x[layout.state(k)] if k else vertcat(x[layout.state(0)], MX.zeros(layout.dof + layout.sums))
            made, limited = step(state, x[layout.control(k)], p[layout.sums :])
            rows.append(x[layout.state(k + 1)] - made)
        at = pose(x[layout.posture(k)], task.targets[k])
        rows.append(at)
        tied = at.numel() + (rows[-2].numel() if k < layout.samples - 1 else 0)
        lower.append(np.zeros(tied))
        upper.append(np.zeros(tied))
        equality += [True] * tied
        if k < layout.samples - 1:
            rows.append(limited)
            lower.append(low)
            upper.append(high)
            equality += [False] * len(low)
    sides = {name: np.full(layout.size, side) for name, side in (("lbx", -np.inf), ("ubx", np.inf))}
    if "position" in task.bounds:
        for k in range(layout.samples):
            for name, side in zip(("lbx", "ubx"), task.bounds["position"][0].T, strict=True):
                sides[name][layout.posture(k)] = side
    sides |= {"lbg": np.concatenate(lower), "ubg": np.concatenate(upper)}
    f = casadi.dot(p[: layout.sums], x[layout.size - layout.sums :])
    return {"x": x, "p": p, "f": f, "g": vertcat(*rows)}, sides, equality


def _options(equality: list[bool], *, warm: bool) -> dict[str, Any]:
    solver = {"tolerance": TOLERANCE, "max_iter": CAP, "print_level": 0, "mu_init": 1e-4 if warm else 1e-2}
    if warm:
        solver |= {"bound_push": 1e-4, "bound_frac": 1e-4}
    structure = {"structure_detection": "auto", "equality": equality}
    return {"print_time": False, "error_on_fail": False, "fatrop": solver, **structure}


def _dt(task: MotionTask) -> float:
    return float(task.times[1] - task.times[0])
