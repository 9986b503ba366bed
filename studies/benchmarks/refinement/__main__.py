"""Our solvers against others on the same programs, from the same starts; losses first.

    python -m studies.benchmarks.refinement [--quick] [--counts] [--time-left] [--cases NAME ...] [--json FILE]

Ours are the interior-point method, which smooths kinks, and SQP with a convex subproblem in cvxpy: canonicalised once
and run by Clarabel, or solved by cvxpy itself at every step (not for sliders: minutes a start). SciPy's solvers get
exact derivatives; IPOPT and FATROP get compiled code, for sliders our functions, called from Python. Absolute values
are slack variables for all of them. A result counts if our exact functions see no violation above 1e-6 and its solver
reports success.

Seconds are of the processor, those of all starts divided by the number that counts. Building programs, compiling, and a
first call are not counted. A peer's row is a loss if it takes less time than "auto", or finds a value better by 1e-6.

``--counts`` prints how often the default verbs canonicalise and run Clarabel; ``--time-left`` judges the stated time
left.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

import paretoik as pk
from paretoik.nlp import sqp
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, Program, Solver
from paretoik.runs.machine import single_blas_thread
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import kim_2021, panda, tringali_2020
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import compiled
from studies.benchmarks.refinement.counts import count_rows, time_left_rows
from studies.benchmarks.refinement.nlp import Method, Nlp, dense_nlp, ipopt_solver, motion_nlp, solve_with_scipy
from studies.benchmarks.refinement.stated import solve_with_cvxpy
from studies.reporting import LOSS, Row, losses_first, report, study_parser, tell, timed

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


class Case(NamedTuple):
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
    Case("3R, torque norm", partial(motions, tringali_2020.simulation_4, pk.torque_norm, SAMPLES), 12),
    Case(
        "3R, mechanical energy: kinks", partial(motions, tringali_2020.simulation_4, pk.mechanical_energy, SAMPLES), 6
    ),
    Case("Panda, kinetic energy", partial(motions, panda.across_the_table, pk.kinetic_energy, SAMPLES), 8),
    Case("Panda, mechanical energy: kinks", partial(motions, panda.across_the_table, pk.mechanical_energy, SAMPLES), 4),
    Case("sliders from point to point, time and work", sliders, 4),
)


VIOLATION = 1e-6
BETTER = 1e-6  # share of the objective
SECONDS, QUICK_SECONDS = 30.0, 10.0  # of SciPy's solvers, per start


@dataclass(frozen=True, kw_only=True, eq=False)
class Ends:
    """Objectives (starts,), NaN for failed starts, and processor seconds (starts,)."""

    objectives: np.ndarray
    seconds: np.ndarray

    @property
    def count(self) -> int:
        """Number of starts that count."""
        return int(np.isfinite(self.objectives).sum())

    @property
    def best(self) -> float:
        """The least objective; inf if no start counts."""
        return float(np.min(self.objectives, where=np.isfinite(self.objectives), initial=np.inf))

    @property
    def each(self) -> float:
        """Seconds of all starts, divided by the number that counts."""
        return float(self.seconds.sum() / self.count) if self.count else np.inf


def solve_all(solve: Solve, starts: np.ndarray) -> Ends:
    """Return the results of all starts, after a first call that is not counted."""
    solve(starts[0])
    objectives, seconds = np.full(len(starts), np.nan), np.zeros(len(starts))
    for i, start in enumerate(starts):
        end, _, seconds[i] = timed(lambda: solve(start))  # noqa: B023, called at once
        if end is not None and end[1] <= VIOLATION:
            objectives[i] = end[0]
    return Ends(objectives=objectives, seconds=seconds)


def tabulate(name: str, default: str, ends: dict[str, Ends]) -> list[Row]:
    """Return one row per solver of a case, that of "auto" first."""
    ours, rows = ends[default], list[Row]()
    for solver, end in ends.items():
        quicker = end.each < ours.each
        better = end.best < ours.best - BETTER * abs(ours.best)
        is_loss = solver != default and (quicker or better)
        outcome = (
            "no start counts" if not end.count else f"best {end.best:.8g}, median {np.nanmedian(end.objectives):.5g}"
        )
        ratio = "what auto takes" if solver == default else f"{end.each / ours.each:.3g} × what auto takes"
        counts = f"{end.count} of {len(end.objectives)} starts"
        note = (LOSS if is_loss else "") + "; ".join([ratio, counts, outcome])
        rows.append(Row(name, solver, "for each start that counts", "s", end.each, note=note))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="two starts, 10 s each for SciPy")
    names = [case.name for case in CASES]
    parser.add_argument("--cases", nargs="+", choices=names, metavar="NAME", help="only these")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--counts", action="store_true", help="canonicalisations and Clarabel solves of default verbs")
    parser.add_argument("--time-left", action="store_true", help="stated time left against the true one")
    options = parser.parse_args(arguments)
    if options.counts:
        report(count_rows(), json_file=options.json)
        return
    if options.time_left:
        report(time_left_rows(), json_file=options.json)
        return
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, single_blas_thread():  # as verbs compute
        for case in CASES:
            if case.name in (options.cases or names):
                tell(f"{case.name}: programs")
                starts, seconds = (2, QUICK_SECONDS) if options.quick else (case.starts, SECONDS)
                contest, ends = case.make(starts, options.seed, seconds, Path(folder)), dict[str, Ends]()
                for solver, solve in contest.contestants.items():
                    tell(f"{case.name}: {solver}")
                    ends[solver] = solve_all(solve, contest.starts)
                rows += tabulate(case.name, contest.default, ends)
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
