"""The programs, their starts, and all solvers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

import paretoik as pk
from paretoik.nlp import sqp
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, Program, Solver
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import kim_2021, panda, tringali_2020
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import compiled
from studies.benchmarks.refinement.nlp import Method, Nlp, dense_nlp, ipopt_solver, motion_nlp, solve_with_scipy
from studies.benchmarks.refinement.stated import solve_with_cvxpy

Move = Callable[[np.ndarray], np.ndarray | None]
Judge = Callable[[np.ndarray], tuple[float, float]]
Solve = Callable[[np.ndarray], tuple[float, float] | None]
STATED = "SQP, each step by cvxpy's own solve"
SAMPLES, SLIDER_SAMPLES = 26, 9  # of motions, so that dense methods can take part
METHODS: tuple[Method, ...] = ("SLSQP", "trust-constr")


@dataclass(frozen=True, kw_only=True, eq=False)
class Contest:
    """A program's start points (starts, ...), and its solvers by name; ``default`` is the one that "auto" takes.

    A solver returns the objective and the largest violation of its result, None if it reports failure.
    """

    starts: np.ndarray
    contestants: dict[str, Solve]
    default: str


@dataclass(frozen=True, kw_only=True)
class Case:
    """A contest by name; ``starts`` is the number of a full run."""

    name: str
    make: Callable[[int, int, float, Path], Contest]
    starts: int


def judge_all(moves: dict[str, Move], judge: Judge) -> dict[str, Solve]:
    """Return solvers whose results are judged."""

    def by(move: Move) -> Solve:
        def solve(x: np.ndarray) -> tuple[float, float] | None:
            end = move(x)
            return None if end is None else judge(end)

        return solve

    return {name: by(move) for name, move in moves.items()}


def our_solvers(program: Program, weights: np.ndarray) -> dict[str, Move]:
    """Return those of our solvers that suit a program."""

    def by(solver: Solver) -> Move:
        def solve(x: np.ndarray) -> np.ndarray | None:
            solutions = minimise(program, x[None], weights[None], solver=solver)
            return np.asarray(solutions.x[0]) if solutions.status[0] == CONVERGED else None

        return solve

    def state_solver(x: np.ndarray) -> np.ndarray | None:
        with patch.object(sqp, "solve_subproblem", solve_with_cvxpy):
            return by("sqp")(x)

    smooth: dict[str, Move] = {} if program.kernel is None else {"interior point": by("interior-point")}
    return {**smooth, "SQP by Clarabel": by("sqp"), STATED: state_solver}


def scipy_solvers(nlp: Nlp, to: Callable[[np.ndarray], np.ndarray], back: Move, seconds: float) -> dict[str, Move]:
    """Return SciPy's solvers, each with a limit of seconds per start."""

    def by(method: Method) -> Move:
        def solve(x: np.ndarray) -> np.ndarray | None:
            end = solve_with_scipy(nlp, to(x), method, seconds)
            return None if end is None else back(end)

        return solve

    return {f"SciPy {method}": by(method) for method in METHODS}


def motions(
    make: Callable[[], pk.Tracking],
    objective: Objective,
    samples: int,
    count: int,
    seed: int,
    seconds: float,
    folder: Path,
) -> Contest:
    """Return the contest of a problem's task with one objective, at a number of samples."""
    task = replace(make().task.resample(samples), objectives=(objective,))
    starts = sample_starts(task, count, np.random.default_rng(seed))
    scale = float(np.median(objective(task.motion(starts))))
    program, ranges = motion_program(task, [scale]), np.array([scale])
    name = f"{objective.name}_{task.arm.dof}"
    plain = joint_program(task)
    joint, staged = compiled(plain, name, folder), compiled(staged_program(task), f"{name}_staged", folder)
    ours = our_solvers(program, np.ones(1))
    moves: dict[str, Move] = {
        **ours,
        **scipy_solvers(motion_nlp(plain, scale), lambda q: plain.pack(q, ranges), plain.unpack, seconds),
        "IPOPT": lambda q: joint.solve(q, ranges=ranges).motion,
        "FATROP": lambda q: staged.solve(q, ranges=ranges).motion,
    }
    return Contest(
        starts=starts, contestants=judge_all(moves, lambda q: judge_motion(task, q)), default=next(iter(ours))
    )


def judge_motion(task: MotionTask, q: np.ndarray) -> tuple[float, float]:
    """Return a motion's objective, and its largest violation or tracking error [m, rad]."""
    motion = task.motion(q)
    violations = np.append(task.violations(motion), motion.tracking_error)
    return float(task.objectives[0](motion)), float(violations.max())


def sliders(count: int, seed: int, seconds: float, folder: Path) -> Contest:
    """Return time plus energy, a second counting as a joule, of sliders from point to point."""
    ends, weights = (kim_2021.START, kim_2021.TARGET), np.ones(2)
    problem = pk.PointToPoint(pk.arms.kim_3r(), pk.capability.kim_sliders(), *ends, samples=SLIDER_SAMPLES)
    points = problem.points(problem.sample_starts(4 * count, np.random.default_rng(seed)))
    points = points[np.isfinite(points).all(axis=1)][:count]
    program = problem.program()
    nlp = dense_nlp(program, weights)

    def judge(z: np.ndarray) -> tuple[float, float]:
        objectives, equalities, inequalities = program.evaluate(z)
        return float(weights @ objectives), float(max(np.abs(equalities).max(), -inequalities.min()))

    ours = our_solvers(program, weights)
    del ours[STATED]  # minutes a start
    peers = scipy_solvers(nlp, lambda z: z, lambda z: z, seconds) | {"IPOPT": ipopt_solver(nlp, points[0])}
    return Contest(starts=points, contestants=judge_all({**ours, **peers}, judge), default=next(iter(ours)))


CASES = (
    Case(name="3R, torque norm", make=partial(motions, tringali_2020.simulation_4, pk.torque_norm, SAMPLES), starts=12),
    Case(
        name="3R, mechanical energy: kinks",
        make=partial(motions, tringali_2020.simulation_4, pk.mechanical_energy, SAMPLES),
        starts=6,
    ),
    Case(
        name="Panda, kinetic energy",
        make=partial(motions, panda.across_the_table, pk.kinetic_energy, SAMPLES),
        starts=8,
    ),
    Case(
        name="Panda, mechanical energy: kinks",
        make=partial(motions, panda.across_the_table, pk.mechanical_energy, SAMPLES),
        starts=4,
    ),
    Case(name="sliders from point to point, time and work", make=sliders, starts=4),
)
