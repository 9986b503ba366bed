"""Local optima from nothing: all distinct locally optimal motions of one objective that many starts lead to.

Source: Tringali & Cocuzza 2020, section 3.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible, SolverFailed
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import STATUSES, Solutions
from paretoik.self_motion.branches import branch_labels
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.levels import OPTIONS, Observe, coarsest_level, level_programs, objective_scales, refine_levels
from paretoik.trajectory.plan_starts import RestartPolicy, disturb_best, initial_motions, sample_starts
from paretoik.trajectory.program import MotionProgram
from paretoik.trajectory.tightening import hold_between
from paretoik.trajectory.transcription import motion_program


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """A locally optimal motion, its objective in the user's own sign, the label of its branch, and a status.

    ``violation_between`` is the worst violation of its limits on a finer grid, as a share of their ranges.
    """

    motion: Motion
    objective: float
    label: str
    status: str
    violation_between: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Distinct local optima, best first, each with ``motion``, ``objective``, ``label`` of its branch and ``status``.

    ``levels`` are the numbers of samples and of optima at each level, coarse to fine.
    """

    optima: tuple[Optimum, ...]
    levels: tuple[tuple[int, int], ...]

    @property
    def best(self) -> Optimum:
        """The best optimum found."""
        return self.optima[0]


def find_optima(
    task: MotionTask,
    *,
    starts: int,
    seed: int,
    initial: Float[np.ndarray, "motions time dof"] | None = None,
    solver: Solver = "auto",
    observe: Observe | None = None,
) -> Plan:
    """Return the distinct local optima of a task with one objective that many starts lead to.

    Starts are those of ``initial_motions``. With one degree of redundancy, as long as some optimum was reached from one
    or two only, there are likely others that none has reached yet (Good 1953: the share of starts that are alone at an
    optimum estimates how likely the next one finds another). Then more are added, the best ways through a coarse grid
    of postures among them where optima stay rare or are many. With more degrees of redundancy more are added, and the
    best perturbed at random, as long as better ones come of it. ``initial`` motions on the path are starts too.
    ``observe`` is called after each level with its number of samples, of starts and of optima.

    Raises InvalidInput where the objective or a limit has no derivative, or a kink and ``solver`` is "interior-point";
    OutOfReach or Infeasible where there is no motion; Infeasible with the least-violating motion where none keeps the
    limits; SolverFailed where limits hold but no start converged.
    """
    assert len(task.objectives) == 1, "one objective at a time is planned for"
    if solver != "auto":  # before any work
        check_solver(motion_program(task), solver)
    level, rng = coarsest_level(task), np.random.default_rng(seed)
    q = sample_starts(level, starts * max(task.redundancy, 1), rng)
    q = q if initial is None else np.concatenate([initial[:, np.searchsorted(task.times, level.times)], q])
    programs = level_programs(task, objective_scales(task, q))
    policy = RestartPolicy(level, q, -(-starts // 2), rng) if programs[-1].is_smooth else None
    solutions, levels = refine_levels(
        programs, q, np.ones(1), np.full(1, np.inf), observe, restore=True, further=policy, solver=solver
    )
    if policy is not None and solutions.converged.any() and policy.exhausted:
        solutions = disturb_best(programs[-1], solutions, solver)
    return Plan(optima=_optima(programs[-1], solutions, solver), levels=levels)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionColdSearch:
    """Plans each objective alone; leads coarse starts below bounds, level by level; a ``ColdSearch``."""

    task: MotionTask
    starts: int
    seed: int
    solver: Solver = "auto"
    observe: Callable[[int, int], object] | None = None

    @property
    def multimodal(self) -> bool:
        """Whether valleys are many: where the self-motion has several dimensions."""
        return self.task.redundancy > 1

    def optima(self, objective: int) -> Float[np.ndarray, "optima time dof"]:
        """Return the local optima of one objective alone, best first. Raises what ``find_optima`` does."""
        alone = replace(self.task, objectives=(self.task.objectives[objective],))
        plan = find_optima(alone, starts=self.starts, seed=self.seed, solver=self.solver, observe=self._show)
        return np.stack([optimum.motion.q for optimum in plan.optima])

    def optima_below(
        self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float
    ) -> Solutions | None:
        """Return what half as many cold starts lead to for one objective, the others below ``upper``, best first."""
        assert isinstance(program, MotionProgram)
        weights = np.full(len(upper), weight)
        weights[main] = 1.0
        programs = level_programs(self.task, program.scales)
        try:
            return refine_levels(programs, self._coarse_starts, weights, upper, self._show, solver=self.solver)[0]
        except Infeasible:  # all that is found leaves the path between samples: nothing below this bound
            return None

    def _show(self, samples: int, starts: int, optima: int) -> None:
        if self.observe is not None:
            self.observe(samples, len(self.task.times))

    @cached_property
    def _coarse_starts(self) -> Float[np.ndarray, "starts samples dof"]:
        return initial_motions(self.task, starts=-(-self.starts // 2), seed=self.seed)


def _optima(program: MotionProgram, solutions: Solutions, solver: Solver) -> tuple[Optimum, ...]:
    """Return the optima, best first, after limits that they exceed between samples are tightened."""
    task = program.task
    if not solutions.converged.any():
        raise _failure(task, task.motion(solutions.x), solutions)
    held = [hold_between(program, x, 1, solver=solver) for x in solutions.x]
    motions = task.motion(np.stack([each.x for each in held]))
    values, labels = task.objectives[0](motions), branch_labels(motions)
    return tuple(
        Optimum(
            motion=motions[i],
            objective=float(values[i]),
            label=labels[i],
            status=STATUSES[int(solutions.status[i])],
            violation_between=held[i].violation,
        )
        for i in np.argsort(task.objectives[0].sign * values, kind="stable").tolist()
    )


def _failure(task: MotionTask, motions: Motion, solutions: Solutions) -> Infeasible | SolverFailed:
    status = STATUSES[int(solutions.status[0])]
    if solutions.violation.max() <= OPTIONS.feasible:
        return SolverFailed(f"no start led to an optimum; the best ended with: {status}")
    violations = task.violations(motions[0])
    return Infeasible(
        "no motion within the limits was found; of the least-violating one, "
        f"{task.describe_violation(motions[0]) or status}",
        motion=motions[0],
        limit=task.limit_names[int(np.argmax(violations))] if task.limit_names else "",
        violation=float(violations.max(initial=0.0)),
    )
