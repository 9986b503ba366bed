"""A motion's nonlinear program as the peers like it best: lean closed-form dynamics, one small function a stage.

The moment of inertia in absolute link angles is A_ij cos(φ_i - φ_j) with φ_i - φ_j made of the last two joint angles
alone, so that three sines and three cosines a sample do. FATROP gets optimal control: state q (and the velocity before
where torques count, the first q on a cycle, what is capped so far), control the velocity ahead. IPOPT gets q alone.
Nothing is shared with paretoik but the task's numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import SX, cos, dot, sin, sumsqr, vertcat

from paretoik.task.motion_task import MotionTask
from studies.benchmarks.reference_front import FITTED, INERTIAS, LENGTHS, PRINTED, coupling

MASSES = {"printed": PRINTED, "fitted": FITTED}
ENERGY, TORQUE = "kinetic_energy", "torque_norm"
INERTIA = 6  # parameters: A_00, A_11, A_22, A_01, A_02, A_12


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Equal stages in a row: a function (z, p) -> (totals, rows), where in x each one's z is, and its rows' bounds."""

    stage: Any
    places: np.ndarray  # (size of z, stages)
    lower: np.ndarray  # (rows, stages)
    upper: np.ndarray
    equality: list[bool]  # of the rows

    @property
    def count(self) -> int:
        """The number of stages."""
        return int(self.places.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Program:
    """Runs over x: the first total is minimised, a second one is the last row; ``*_at`` (samples, ...) lead into x.

    ``sum_at`` is where x holds what a capped total has come to, if x does.
    """

    runs: tuple[Run, ...]
    lower: np.ndarray
    upper: np.ndarray
    joints_at: np.ndarray
    velocities_at: np.ndarray
    before_at: np.ndarray
    first_at: np.ndarray
    sum_at: np.ndarray
    capped: bool

    @property
    def totals(self) -> int:
        """One, or two where the last row is a total."""
        return 1 + int(self.capped and not len(self.sum_at))

    def rows(self, side: str) -> np.ndarray:
        """Return the ``lower`` or ``upper`` bounds of all rows; nothing is capped yet."""
        free = np.full(self.totals - 1, -np.inf if side == "lower" else np.inf)
        return np.concatenate([*(getattr(run, side).T.ravel() for run in self.runs), free])

    def packed(self, q: np.ndarray, dt: float) -> np.ndarray:
        """Return x of joint angles (samples, 3); what is capped is left at nought."""
        x, rates = np.zeros(len(self.lower)), np.diff(q, axis=0) / dt
        x[self.joints_at] = q[: len(self.joints_at)]
        x[self.velocities_at] = rates[: len(self.velocities_at)]
        x[self.before_at] = rates[: len(self.before_at)]
        x[self.first_at] = q[0]
        return x


def inertia(masses: str) -> np.ndarray:
    """Return the parameters of an arm: three diagonal and three other elements of A."""
    assert np.allclose(INERTIAS, [0.001811, 0.003173, 0.002103])
    A = coupling(MASSES[masses])
    return np.array([A[0, 0], A[1, 1], A[2, 2], A[0, 1], A[0, 2], A[1, 2]])


def tool(q: Any) -> Any:
    """Return the tool's place."""
    phi = casadi.cumsum(q)
    return vertcat(dot(LENGTHS, cos(phi)), dot(LENGTHS, sin(phi)))


def kinetic_energy(q: Any, v: Any, p: Any) -> Any:
    """Return the kinetic energy."""
    w = casadi.cumsum(v)
    mixed = p[3] * cos(q[1]) * w[0] * w[1] + p[4] * cos(q[1] + q[2]) * w[0] * w[2] + p[5] * cos(q[2]) * w[1] * w[2]
    return (p[0] * w[0] ** 2 + p[1] * w[1] ** 2 + p[2] * w[2] ** 2) / 2 + mixed


def torques(q: Any, v: Any, a: Any, p: Any) -> Any:
    """Return the joint torques: generalised forces on φ_i are Σ_j A_ij (φ̈_j cos φ_ij + φ̇_j² sin φ_ij)."""
    w, change = casadi.cumsum(v) ** 2, casadi.cumsum(a)
    c01, c02, c12 = p[3] * cos(q[1]), p[4] * cos(q[1] + q[2]), p[5] * cos(q[2])
    s01, s02, s12 = p[3] * sin(q[1]), p[4] * sin(q[1] + q[2]), p[5] * sin(q[2])
    first = p[0] * change[0] + c01 * change[1] + c02 * change[2] - s01 * w[1] - s02 * w[2]
    second = p[1] * change[1] + c01 * change[0] + c12 * change[2] + s01 * w[0] - s12 * w[2]
    third = p[2] * change[2] + c02 * change[0] + c12 * change[1] + s02 * w[0] + s12 * w[1]
    return vertcat(first + second + third, second + third, third)


def optimal_control(task: MotionTask, main: str, capped: str = "") -> Program:
    """Return the program as FATROP wants it: every stage's gap to the next, its task, its limits."""
    samples, dt = len(task.times), float(task.times[1] - task.times[0])
    rated = TORQUE in (main, capped) or not {"torque", "power"}.isdisjoint(task.bounds)
    assert not (rated and task.cyclic), "a cycle has energies only"
    names = [("q", 3), ("before", 3 * rated), ("first", 3 * task.cyclic), ("sum", bool(capped))]
    later = {name: size for name, size in names if size}
    start = {name: size for name, size in later.items() if name in ("q", "first")}
    at, size = [], 0
    for k in range(samples):
        sizes = {**(later if k else start), **({"u": 3} if k < samples - 1 else {})}
        ends = np.cumsum([0, *sizes.values()]) + size
        at.append({name: np.arange(a, b) for name, a, b in zip(sizes, ends, ends[1:], strict=False)})
        size = int(ends[-1])
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    for kind, name in (("position", "q"), ("velocity", "u")):
        if kind in task.bounds:
            for stage in at[: samples - (name == "u")]:
                lower[stage[name]], upper[stage[name]] = task.bounds[kind][0].T

    def run(of: range) -> Run:
        z = {name: SX.sym(name, len(where)) for name, where in at[of[0]].items()}
        ahead = {name: SX.sym(name, size) for name, size in later.items()} if of[-1] < samples - 1 else {}
        p, rows, total = SX.sym("p", INERTIA), [], SX(0)
        closing = task.cyclic and of[-1] == samples - 1
        limits: list[tuple[Any, np.ndarray, np.ndarray]] = []
        if ahead:
            q = z["q"] + dt * z["u"]
            a = (z["u"] - z.get("before", SX.zeros(3))) / dt
            tau = torques(q, z["u"], a, p) if rated else SX.zeros(3)
            worth = {ENERGY: dt * kinetic_energy(q, z["u"], p), TORQUE: dt * sumsqr(tau)}
            total = worth[main]
            then = {"q": q, "before": z["u"], "first": z.get("first", z["q"])}
            if capped:
                then["sum"] = z.get("sum", SX(0)) + worth[capped]
            rows = [ahead[name] - then[name] for name in ahead]
            given = {"torque": tau, "power": tau * z["u"]}
            limits = [(what, *task.bounds[kind][0].T) for kind, what in given.items() if kind in task.bounds]
        gaps = sum(later.values()) if ahead else 0
        level = np.zeros((gaps, len(of)))
        if not closing:
            rows.append(tool(z["q"]))
            level = np.concatenate([level, task.targets[of[0] : of[-1] + 1, :2].T])
        if task.cyclic and of[0] in (0, samples - 1):
            rows.append(z["q"] - z["first"])
            level = np.concatenate([level, np.zeros((3, len(of)))])
        sides = [np.concatenate([level, *(np.tile(s[i][:, None], len(of)) for s in limits)]) for i in (1, 2)]
        z_all = vertcat(*z.values(), *ahead.values())
        return Run(
            stage=casadi.Function("stage", [z_all, p], [total, vertcat(*rows, *(s[0] for s in limits))]),
            places=np.stack([_places(at, k, list(z), list(ahead)) for k in of], axis=1),
            lower=sides[0],
            upper=sides[1],
            equality=[True] * len(level) + [False] * (len(sides[0]) - len(level)),
        )

    runs = (run(range(1)), run(range(1, samples - 1)), run(range(samples - 1, samples)))
    joined = {name: [s[name] for s in at if name in s] for name in ("q", "u", "before", "first", "sum")}
    where = {name: np.array(v, dtype=int).reshape(-1, 1 if name == "sum" else 3) for name, v in joined.items()}
    return Program(
        runs=runs,
        lower=lower,
        upper=upper,
        joints_at=where["q"],
        velocities_at=where["u"],
        before_at=where["before"],
        first_at=where["first"],
        sum_at=where["sum"][:, 0],
        capped=bool(capped),
    )


def _places(at: list[dict[str, np.ndarray]], k: int, names: Sequence[str], ahead: Sequence[str]) -> np.ndarray:
    return np.concatenate([*(at[k][name] for name in names), *(at[k + 1][name] for name in ahead)])


def over_joints(task: MotionTask, main: str, capped: str = "") -> Program:
    """Return the program as IPOPT wants it: joint angles alone, on a cycle without the last ones."""
    samples, dt = len(task.times), float(task.times[1] - task.times[0])
    rated = TORQUE in (main, capped) or not {"torque", "power"}.isdisjoint(task.bounds)
    assert not (rated and task.cyclic), "a cycle has energies only"
    unknown = samples - task.cyclic
    free = np.full((3, 2), [-np.inf, np.inf])
    position = task.bounds["position"][0] if "position" in task.bounds else free
    nothing = np.zeros((0, 3), dtype=int)

    def run(of: range, reach: int) -> Run:
        """Return samples that look back at ``reach`` others."""
        q, p = [SX.sym(f"q{i}", 3) for i in range(reach + 1)], SX.sym("p", INERTIA)
        tracked = of[-1] < unknown
        rows = [tool(q[-1])] if tracked else []
        level = task.targets[of[0] : of[-1] + 1, :2].T if tracked else np.zeros((0, len(of)))
        worth = {ENERGY: SX(0), TORQUE: SX(0)}
        limits: list[tuple[Any, np.ndarray, np.ndarray]] = []
        if reach:
            v = (q[-1] - q[-2]) / dt
            before = (q[-2] - q[-3]) / dt if reach > 1 else SX.zeros(3)
            tau = torques(q[-1], v, (v - before) / dt, p) if rated else SX.zeros(3)
            worth = {ENERGY: dt * kinetic_energy(q[-1], v, p), TORQUE: dt * sumsqr(tau)}
            given = {"velocity": v, "torque": tau, "power": tau * v}
            limits = [(what, *task.bounds[kind][0].T) for kind, what in given.items() if kind in task.bounds]
        sides = [np.concatenate([level, *(np.tile(s[i][:, None], len(of)) for s in limits)]) for i in (1, 2)]
        totals = vertcat(*(worth[name] for name in (main, capped) if name))
        looked = np.arange(-reach, 1)[:, None] + np.array(of)
        places = (3 * (looked % unknown)[:, None] + np.arange(3)[:, None]).reshape(-1, len(of))
        equality = [True] * len(level) + [False] * (len(sides[0]) - len(level))
        stage = casadi.Function("stage", [vertcat(*q), p], [totals, vertcat(*rows, *(s[0] for s in limits))])
        return Run(stage=stage, places=places, lower=sides[0], upper=sides[1], equality=equality)

    runs = [run(range(1), 0), *([run(range(1, 2), 1)] if rated else []), run(range(1 + rated, unknown), 1 + rated)]
    if task.cyclic:
        runs.append(run(range(unknown, samples), 1))
    return Program(
        runs=tuple(runs),
        lower=np.tile(position[:, 0], unknown),
        upper=np.tile(position[:, 1], unknown),
        joints_at=np.arange(3 * unknown).reshape(-1, 3),
        velocities_at=nothing,
        before_at=nothing,
        first_at=nothing,
        sum_at=nothing[:, 0],
        capped=bool(capped),
    )
