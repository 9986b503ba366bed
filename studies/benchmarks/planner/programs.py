"""A motion's nonlinear program in the peers' best form: lean closed-form dynamics, one small function per stage.

The moment of inertia in absolute link angles is A_ij cos(φ_i - φ_j), and φ_i - φ_j depends on the last two joint angles
only, so that three sines and three cosines per sample are enough. FATROP gets optimal control. Its state is q (and the
velocity before if torques count, the first q on a cycle, the capped sum so far), its control the velocity ahead. IPOPT
gets q only. Nothing is shared with paretoik except the task's numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi
import numpy as np
from casadi import SX, cos, dot, sin, sumsqr, vertcat

from paretoik.task.motion_task import MotionTask
from studies.benchmarks.reference_program import FITTED, INERTIAS, LENGTHS, PRINTED, coupling

MASSES = {"printed": PRINTED, "fitted": FITTED}
ENERGY, TORQUE = "kinetic_energy", "torque_norm"
Level: TypeAlias = list[tuple[Any, np.ndarray]]  # rows and their values, (rows or one, stages or one)
INERTIA = 6  # parameters: A_00, A_11, A_22, A_01, A_02, A_12


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Equal stages in a row: a function (z, p) -> (totals, rows), the places of each z in x, and its rows' bounds."""

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
    """Runs over x: the first total is minimised, a second one is the last row; ``*_at`` (samples, ...) are places in x.

    ``sum_at`` is the place of the capped sum in x, if there is one.
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
        """One, or two if the last row is a total."""
        return 1 + int(self.capped and not len(self.sum_at))

    def rows(self, side: str) -> np.ndarray:
        """Return the ``lower`` or ``upper`` bounds of all rows; nothing is capped yet."""
        free = np.full(self.totals - 1, -np.inf if side == "lower" else np.inf)
        return np.concatenate([*(getattr(run, side).T.ravel() for run in self.runs), free])

    def packed(self, q: np.ndarray, dt: float) -> np.ndarray:
        """Return x of joint angles (samples, 3); capped sums are zero."""
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
    """Return the tool's position."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedTask:
    """A task, its objective, and the capped quantity, if any."""

    task: MotionTask
    main: str
    capped: str

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.task.times)

    @property
    def dt(self) -> float:
        """The time between samples."""
        return float(self.task.times[1] - self.task.times[0])

    @property
    def rated(self) -> bool:
        """Whether torques, and so accelerations, count."""
        rated = TORQUE in (self.main, self.capped) or not {"torque", "power"}.isdisjoint(self.task.bounds)
        assert not (rated and self.task.cyclic), "a cycle has energies only"
        return rated

    def stage(self, q: Any, v: Any, before: Any, p: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return a sample's shares of both objectives, and the quantities that may be limited."""
        tau = torques(q, v, (v - before) / self.dt, p) if self.rated else SX.zeros(3)
        adds = {ENERGY: self.dt * kinetic_energy(q, v, p), TORQUE: self.dt * sumsqr(tau)}
        return adds, {"velocity": v, "torque": tau, "power": tau * v}

    def run(self, z: Any, p: Any, totals: Any, level: Level, limited: Mapping[str, Any], places: np.ndarray) -> Run:
        """Return stages at ``places`` whose rows are equalities, then limited quantities."""
        kinds = [kind for kind in limited if kind in self.task.bounds]
        limits, count = [self.task.bounds[kind][0].T[:, :, None] for kind in kinds], places.shape[1]
        what = [row for row, _ in level]
        values = [np.broadcast_to(value, (row.numel(), count)) for row, value in level]
        equal = np.concatenate([np.zeros((0, count)), *values])
        lower, upper = (np.concatenate([equal, *(np.tile(each[side], count) for each in limits)]) for side in (0, 1))
        stage = casadi.Function("stage", [z, p], [totals, vertcat(*what, *(limited[kind] for kind in kinds))])
        equality = [i < len(equal) for i in range(len(lower))]
        return Run(stage=stage, places=places, lower=lower, upper=upper, equality=equality)


def optimal_control(task: MotionTask, main: str, capped: str = "") -> Program:
    """Return the program in FATROP's form: every stage's gap to the next, its task, its limits."""
    posed = PosedTask(task=task, main=main, capped=capped)
    samples, rated = posed.samples, posed.rated
    state = {"q": 3, "before": 3 * rated, "first": 3 * task.cyclic, "sum": int(bool(capped))}
    state = {name: size for name, size in state.items() if size}
    at, size = list[dict[str, np.ndarray]](), 0
    for k in range(samples):
        begin = {name: size for name, size in state.items() if name in ("q", "first")}
        sizes = {**(state if k else begin), **({"u": 3} if k < samples - 1 else {})}
        ends = np.cumsum([size, *sizes.values()])
        at.append({name: np.arange(a, b) for name, a, b in zip(sizes, ends, ends[1:], strict=False)})
        size = int(ends[-1])
    lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
    for kind, name in (("position", "q"), ("velocity", "u")):
        if kind in task.bounds:
            for stage in at[: samples - (name == "u")]:
                lower[stage[name]], upper[stage[name]] = task.bounds[kind][0].T
    joined = {name: [s[name] for s in at if name in s] for name in ("q", "u", "before", "first", "sum")}
    where = {name: np.array(v, dtype=int).reshape(-1, 1 if name == "sum" else 3) for name, v in joined.items()}
    stages = (range(1), range(1, samples - 1), range(samples - 1, samples))
    return Program(
        runs=tuple(_control_stages(posed, state, at, of) for of in stages),
        lower=lower,
        upper=upper,
        joints_at=where["q"],
        velocities_at=where["u"],
        before_at=where["before"],
        first_at=where["first"],
        sum_at=where["sum"][:, 0],
        capped=bool(capped),
    )


def _control_stages(posed: PosedTask, state: Mapping[str, int], at: list[dict[str, np.ndarray]], of: range) -> Run:
    """Return stages of optimal control, the last one without a next."""
    task, last = posed.task, of[-1] == posed.samples - 1
    z = {name: SX.sym(name, len(where)) for name, where in at[of[0]].items()}
    ahead = {name: SX.sym(name, size) for name, size in state.items() if not last}
    p, total, limited, level = SX.sym("p", INERTIA), SX(0), dict[str, Any](), Level()
    if not last:
        q = z["q"] + posed.dt * z["u"]
        adds, limited = posed.stage(q, z["u"], z.get("before", SX.zeros(3)), p)
        total = adds[posed.main]
        then = {
            "q": q,
            "before": z["u"],
            "first": z.get("first"),
            "sum": z.get("sum", SX(0)) + adds.get(posed.capped, 0),
        }
        level = [(ahead[name] - then[name], np.zeros((1, 1))) for name in ahead]
        del limited["velocity"]  # a bound of x
    if not (last and task.cyclic):
        level.append((tool(z["q"]), task.targets[of[0] : of[-1] + 1, :2].T))
    if task.cyclic and (last or of[0] == 0):
        level.append((z["q"] - z["first"], np.zeros((1, 1))))
    places = [np.concatenate([*(at[k][name] for name in z), *(at[k + 1][name] for name in ahead)]) for k in of]
    return posed.run(vertcat(*z.values(), *ahead.values()), p, total, level, limited, np.stack(places, axis=1))


def over_joints(task: MotionTask, main: str, capped: str = "") -> Program:
    """Return the program in IPOPT's form: joint angles only, on a cycle without the last ones."""
    posed = PosedTask(task=task, main=main, capped=capped)
    rated, unknown = posed.rated, posed.samples - task.cyclic
    # number of samples before one that it needs: none for the first, one after a rest, two if accelerations count
    reaches = [(range(1), 0), (range(1, 1 + rated), 1), (range(1 + rated, unknown), 1 + rated)]
    reaches.append((range(unknown, posed.samples), 1))
    position = task.bounds["position"][0] if "position" in task.bounds else np.full((3, 2), [-np.inf, np.inf])
    nothing = np.zeros((0, 3), dtype=int)
    return Program(
        runs=tuple(_looking_back(posed, of, reach, unknown) for of, reach in reaches if len(of)),
        lower=np.tile(position[:, 0], unknown),
        upper=np.tile(position[:, 1], unknown),
        joints_at=np.arange(3 * unknown).reshape(-1, 3),
        velocities_at=nothing,
        before_at=nothing,
        first_at=nothing,
        sum_at=nothing[:, 0],
        capped=bool(capped),
    )


def _looking_back(posed: PosedTask, of: range, reach: int, unknown: int) -> Run:
    """Return samples that depend on the given number of samples before them."""
    q, p = [SX.sym(f"q{i}", 3) for i in range(reach + 1)], SX.sym("p", INERTIA)
    adds: dict[str, Any] = {ENERGY: SX(0), TORQUE: SX(0)}
    limited = dict[str, Any]()
    if reach:
        before = (q[-2] - q[-3]) / posed.dt if reach > 1 else SX.zeros(3)
        adds, limited = posed.stage(q[-1], (q[-1] - q[-2]) / posed.dt, before, p)
    closing = of[0] == unknown
    level = [] if closing else [(tool(q[-1]), posed.task.targets[of[0] : of[-1] + 1, :2].T)]
    totals = vertcat(*(adds[name] for name in (posed.main, posed.capped) if name))
    looked = (np.arange(-reach, 1)[:, None] + np.array(of)) % unknown
    places = (3 * looked[:, None] + np.arange(3)[:, None]).reshape(-1, len(of))
    return posed.run(vertcat(*q), p, totals, level, limited, places)
