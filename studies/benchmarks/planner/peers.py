"""CasADi's FATROP and IPOPT: questions and answers."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import casadi
import numpy as np

import paretoik as pk
from paretoik.task.motion_task import MotionTask
from problems import tringali_2020
from studies.benchmarks.planner.programs import ENERGY, INERTIA, TORQUE, Program, inertia, optimal_control, over_joints

Settings: TypeAlias = tuple[tuple[str, float], ...]

SAMPLES = 101
LABELS = {"fatrop": "FATROP", "ipopt": "IPOPT"}
TOLERANCE, CAP = 1e-8, 100  # of stationarity; iterations
BEGINNINGS: tuple[Settings, ...] = tuple((("mu_init", mu),) for mu in (0.1, 0.01, 0.001))
# a warm start that is pushed off its bounds goes elsewhere
PUSHES = ("bound_push", "bound_frac")
WIDENED = 1e-8  # FATROP relaxes bounds by this, times their size if above one


@dataclass(frozen=True, kw_only=True)
class Question:
    """A question to a peer: a problem of Tringali & Cocuzza, its samples; ``library`` if it is compiled."""

    solver: str  # "fatrop" or "ipopt"
    problem: str
    samples: int
    main: str = ""
    capped: str = ""
    library: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """The result of a start: joint angles (samples, 3), objective, whether the solver converged, its cost."""

    q: np.ndarray
    value: float
    solved: bool
    seconds: float
    cpu: float  # seconds too
    iterations: int


@lru_cache(maxsize=64)  # this also makes what a search needs
def tracking(name: str, masses: str = "printed", samples: int = SAMPLES) -> pk.Tracking:
    """Return a problem of Tringali & Cocuzza for either arm, at any number of samples."""
    task = getattr(tringali_2020, name)().task
    path = tringali_2020.round_trip(samples) if task.cyclic else tringali_2020.straight(samples)
    sides: dict[str, Any] = {kind: (bounds[0, :, 0], bounds[0, :, 1]) for kind, bounds in task.bounds.items()}
    arm = pk.arms.tringali_3r(masses)  # type: ignore[arg-type]
    return pk.Tracking(
        arm, path, objectives=task.objectives, limits=pk.Limits(**sides), cyclic=task.cyclic, differences="backward"
    )


@lru_cache(maxsize=64)
def task_of(name: str, masses: str, samples: int) -> MotionTask:
    """Return the task of a problem, thinned out if fewer samples are asked for than it has."""
    if samples < SAMPLES:
        return tracking(name, masses).task.subsample(samples)
    return tracking(name, masses, samples).task


class Peer:
    """A solver at a task's samples."""

    def __init__(self, question: Question, settings: Settings) -> None:
        self.question, self.program = question, program_of(question)
        self.dt = 1.0 / (question.samples - 1)
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            question.solver: _own(question, settings),
        }
        if question.solver == "fatrop":
            equality = [kind for run in self.program.runs for kind in run.equality * run.count]
            options |= {"structure_detection": "auto", "equality": equality}
        what = question.library or written_out(self.program)
        self.solver = casadi.nlpsol("peer", question.solver, what, options)
        self.sums = casadi.Function("sums", *signature(written_out(self.program))) if len(self.program.sum_at) else None
        program = self.program
        self.x_sides = self._narrow(program.lower, program.upper)
        self.row_sides = self._narrow(program.rows("lower"), program.rows("upper"))
        self.lower = {"lbx": casadi.DM(self.x_sides[0]), "lbg": casadi.DM(self.row_sides[0])}

    def _narrow(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return narrow(lower, upper) if self.question.solver == "fatrop" else (lower, upper)

    def start(self, q: np.ndarray, masses: str) -> np.ndarray:
        """Return x of joint angles."""
        x = self.program.packed(q, self.dt)
        if self.sums is not None:
            # with sums of zero, their gaps lack a stage's share; they come fourth after q and the velocity
            rows = np.asarray(self.sums(x, inertia(masses))[1]).ravel()
            width = [run.lower.shape[0] for run in self.program.runs for _ in range(run.count)]
            begins = np.cumsum([0, *width])[: len(self.program.sum_at)]
            x[self.program.sum_at] = np.cumsum(-rows[begins + 6])
        return x

    def solve(self, q: np.ndarray, masses: str = "printed", cap: float = np.inf) -> Solved:
        """Return the solution from joint angles (samples, 3)."""
        x0, program = casadi.DM(self.start(q, masses)), self.program
        upper, upper_rows = self.x_sides[1].copy(), self.row_sides[1].copy()
        if program.capped and len(program.sum_at):
            upper[program.sum_at[-1]] = cap - WIDENED * max(1.0, abs(cap)) if np.isfinite(cap) else cap
        elif program.capped:
            upper_rows[-1] = cap
        bounds = {**self.lower, "ubx": casadi.DM(upper), "ubg": casadi.DM(upper_rows)}
        p = casadi.DM(inertia(masses))
        started, cpu = time.perf_counter(), time.process_time()
        solution = self.solver(x0=x0, p=p, **bounds)
        seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
        stats = self.solver.stats()
        motion = np.asarray(solution["x"]).ravel()[program.joints_at]
        if len(motion) < len(q):
            motion = np.concatenate([motion, motion[:1]])
        return Solved(
            q=motion,
            value=float(solution["f"]),
            solved=bool(stats["success"]),
            seconds=seconds,
            cpu=cpu,
            iterations=int(stats["iter_count"]),
        )


def narrow(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return narrower bounds: FATROP widens them again, which CasADi cannot turn off."""
    free = lower < upper
    moved = []
    for side, way in ((lower, 1.0), (upper, -1.0)):
        touched = free & np.isfinite(side)
        moved.append(side.copy())
        moved[-1][touched] += way * WIDENED * np.maximum(1.0, np.abs(side[touched]))
    return moved[0], moved[1]


def _own(question: Question, settings: Settings) -> dict[str, Any]:
    chosen = dict(settings)
    if question.solver == "fatrop":
        return {"tolerance": TOLERANCE, "max_iter": CAP, "print_level": 0, **chosen}
    quiet = {"print_level": 0, "sb": "yes", "bound_relax_factor": 0.0}
    renamed = {"tol" if name == "tolerance" else name: value for name, value in chosen.items()}
    if "bound_push" in chosen:
        renamed |= {f"slack_{name}": chosen["bound_push"] for name in PUSHES}
    return {**quiet, "tol": TOLERANCE, "max_iter": CAP, **renamed}


def program_of(question: Question) -> Program:
    """Return the program of a question."""
    task = task_of(question.problem, "printed", question.samples)
    main = question.main or task.objectives[0].name
    assert {main, question.capped} <= {ENERGY, TORQUE, ""}
    return (optimal_control if question.solver == "fatrop" else over_joints)(task, main, question.capped)


def written_out(program: Program) -> dict[str, Any]:
    """Return the program with every stage written out, which CasADi itself evaluates fastest."""
    x, p = casadi.SX.sym("x", len(program.lower)), casadi.SX.sym("p", INERTIA)
    totals: Any = casadi.SX.zeros(program.totals)
    rows: list[Any] = []
    for run in program.runs:
        for places in run.places.T:
            total, row = run.stage(x[places.tolist()], p)
            totals += total
            rows.append(row)
    return {"x": x, "p": p, "f": totals[0], "g": casadi.vertcat(*rows, *casadi.vertsplit(totals)[1:])}


def signature(problem: dict[str, Any]) -> tuple[list[Any], list[Any]]:
    """Return the inputs and the outputs of a problem."""
    return [problem["x"], problem["p"]], [problem["f"], problem["g"]]


@lru_cache(maxsize=64)
def peer(question: Question, settings: Settings = ()) -> Peer:
    """Return a peer, built once per process."""
    return Peer(question, settings)


def solved(
    question: Question, settings: Settings, masses: str, starts: np.ndarray, caps: np.ndarray | None = None
) -> list[Solved]:
    """Return the solutions from starts (any, samples, 3)."""
    asked, caps = peer(question, settings), np.full(len(starts), np.inf) if caps is None else caps
    return [asked.solve(q, masses, float(cap)) for q, cap in zip(starts, caps, strict=True)]
