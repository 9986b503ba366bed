"""Plans: all distinct local optima of one objective from many starts (Tringali & Cocuzza 2020, section 3.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.errors import EvaluationFailed, Infeasible, SolverFailed
from paretoik.front.hypervolume import OPTIONS as INDICATORS
from paretoik.front.points import ADDED_SAMPLES, confirmation
from paretoik.nlp.minimise import check_solver, chosen_solver
from paretoik.nlp.program import (
    CONVERGED,
    FEASIBLE,
    INTERRUPTED,
    NOT_FINITE,
    STATUSES,
    Program,
    Solutions,
    Solver,
    concatenate,
)
from paretoik.pareto.certificates import OPTIONS as CERTIFICATES
from paretoik.pareto.certificates import confirmed_criticality
from paretoik.pareto.scalarisation import Observe, insert_best, minimise_from, naming_objective
from paretoik.pareto.sweep import OPTIONS as EPSILON
from paretoik.stop_flag import Interrupted
from paretoik.tables import columns, fit_screen, html_representation, represented
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.self_motion import branch_labels
from paretoik.trajectory.functions import trace_functions
from paretoik.trajectory.infeasibility import infeasible_error, require_feasible
from paretoik.trajectory.levels import (
    LevelProgress,
    ObserveLevel,
    coarsest_level,
    distinct_rows,
    explained_interruption,
    first_levels,
    level_programs,
    level_progress,
    objective_scales,
    on_more_samples,
    refine_levels,
    resample,
)
from paretoik.trajectory.plan_starts import OPTIONS as STARTS
from paretoik.trajectory.plan_starts import LevelRestarts, first_portions, initial_motions, sample_starts
from paretoik.trajectory.tightening import feasible_motions, hold_all
from paretoik.trajectory.transcription import MotionProgram, motion_program

EXCEEDS = "limits exceeded between samples"  # status of an optimum that exceeds limits although they were tightened
UNDER_RESOLVED = "under-resolved"  # status of an optimum whose value differs too much from that of its curve


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """A locally optimal motion.

    motion: the motion
    objective: value of the objective, in the user's own sign
    label: label of the motion's branch
    status: status of the solver, or a fault such as "under-resolved"
    violation_between: upper bound of its violation of limits at any time, as a share of their ranges
    criticality: first-order gain that its objective still has, as a share of the best optimum's objective, confirmed by
        a convex program; NaN if unknown
    discretisation_error: error of ``objective`` relative to the motion's curve, in its unit; NaN in older runs

    An optimum of a spline whose error is more than 0.1 % of the value is "under-resolved".
    """

    motion: Motion
    objective: float
    label: str
    status: str
    violation_between: float
    criticality: float = np.nan
    discretisation_error: float = np.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Distinct local optima, best first.

    optima: optima with ``motion``, ``objective``, ``label`` and ``status``
    levels: numbers of samples and of optima at each level, coarse to fine
    starts: number of motions that the first level started from
    provenance: record of how the plan was made, as for a front
    """

    optima: tuple[Optimum, ...]
    levels: tuple[tuple[int, int], ...]
    starts: int = 0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def best(self) -> Optimum:
        """The best optimum found."""
        return self.optima[0]

    def __repr__(self) -> str:
        """Return one line per optimum, best first."""
        rows = [("place", "objective", "branch", "status", "violation between samples")]
        for place, each in enumerate(self.optima):
            rows.append((str(place), f"{each.objective:.6g}", each.label, each.status, f"{each.violation_between:.1e}"))
        count = "1 optimum" if len(self.optima) == 1 else f"{len(self.optima)} distinct optima"
        return fit_screen(f"Plan of {count}: .optima, .best.motion\n{columns(rows)}")

    _repr_html_ = html_representation


def find_optima(
    task: MotionTask,
    *,
    starts: int | None = None,
    seed: int,
    initial: Float[np.ndarray, "motions time dof"] | None = None,
    solver: Solver = "auto",
    observe: ObserveLevel | None = None,
    rollouts: JointPaths | None = None,
) -> Plan:
    """Return the local optima of one objective that many starts find.

    starts: number of starts per degree of redundancy; None for up to 48, fewer if a better optimum becomes unlikely
    seed: seed of random numbers
    initial: motions on the path that are starts too, minimised at the task's own samples; the best optimum is at least
        as good as the best feasible one of these
    solver: solver of the local searches
    observe: function called after each level
    rollouts: motions on the path, the least-violating first; if none satisfies the limits, ``require_feasible`` first
        checks whether another motion can

    - Starts are minimised at the coarsest level of samples that leads to an optimum.
    - ``RestartPolicy`` adds independent starts there while a better unseen optimum is likely, and on the next level too
      if values change much. If there are many optima, it also perturbs the best at random while that finds better ones.
    - The distinct optima are refined on finer levels up to the task's own samples.
    - On one of these levels the best are perturbed again, if optima are many.

    Raises InvalidInput if the objective or a limit has no derivative, or if ``solver`` does not support one of them;
    OutOfReach or Infeasible if there is no motion; Infeasible with the least-violating motion if none satisfies the
    limits; SolverFailed if limits are satisfied but no start converged; EvaluationFailed if no start converged and a
    search ended at a motion without a value.
    """
    assert len(task.objectives) == 1, "a plan has one objective"
    if solver != "auto":  # refuse an unsuitable solver before any work
        check_solver(motion_program(task), solver)
    trace_functions(task, np.ones(1))  # raises InvalidInput for functions without a derivative
    given: Solutions | None = None  # minimised initial motions, if some of them are feasible
    if initial is not None and len(initial):
        program = motion_program(task, objective_scales(task, initial))
        ends = minimise_from(program, initial, np.ones(1), solver=solver)
        given = ends[ends.violation <= FEASIBLE] if (ends.violation <= FEASIBLE).any() else None
    try:
        solutions, levels, count = _search(task, starts, seed, initial, solver, observe, rollouts)
    except (EvaluationFailed, Infeasible, SolverFailed, Interrupted):
        if given is None:
            raise
        solutions, levels, count = given, (), len(given)
    solutions = solutions if given is None else _merge(task, solutions, given)
    return _plan(task, solutions, initial, levels, count, solver)


def resolve_plan(
    task: MotionTask,
    plan: Plan,
    rollouts: JointPaths,
    *,
    given: int,
    solver: Solver = "auto",
    observe: ObserveLevel | None = None,
) -> Plan:
    """Return a plan on more samples if an optimum is under-resolved.

    rollouts: motions that give the objective's size; errors below its rounding error count as 0
    given: number of samples that the user chose

    See ``on_more_samples``. All optima are minimised again on more samples, and keep their status if they do not
    converge there. Those that leave the path between their samples are dropped; if the best one does, or none
    converges, the plan stays the same.
    """

    def errors(found: tuple[MotionTask, Plan]) -> Float[np.ndarray, " inexact"]:
        inexact = [each for each in found[1].optima if each.status == UNDER_RESOLVED]
        rounding = INDICATORS.rounding * objective_scales(task, rollouts)[0] if inexact else 0.0
        sizes = [(each.discretisation_error, abs(each.objective)) for each in inexact]
        return np.array([error / max(size, 1e-300) for error, size in sizes if error > rounding])

    def refine(found: tuple[MotionTask, Plan]) -> tuple[MotionTask, Plan] | None:
        former, plan = found
        finer, q = former.with_midpoints(), np.stack([each.motion.q for each in plan.optima])
        former.motion(q[:1]).at(finer.times)  # raises Infeasible if the best motion leaves the path
        starts = resample(former, q, finer)
        ends = minimise_from(motion_program(finer, objective_scales(finer, starts)), starts, np.ones(1), solver=solver)
        if not ends.converged.any():
            return None
        solutions = concatenate((_merge(finer, ends[ends.converged], ends[:0]), ends[~ends.converged]))
        if observe is not None:
            observe(level_progress(finer, starts, ends, solutions))
        resolved = _plan(finer, solutions, None, plan.levels, plan.starts, solver)
        levels = (*plan.levels, (len(finer.times), len(resolved.optima)))
        samples = {ADDED_SAMPLES: {"path": given, "used": len(finer.times)}}
        return finer, replace(resolved, levels=levels, provenance={**resolved.provenance, **samples})

    return on_more_samples((task, plan), errors, refine)[1]


def _search(
    task: MotionTask,
    starts: int | None,
    seed: int,
    initial: Float[np.ndarray, "motions time dof"] | None,
    solver: Solver,
    observe: ObserveLevel | None,
    rollouts: JointPaths | None,
) -> tuple[Solutions, tuple[tuple[int, int], ...], int]:
    """Return the distinct optima, the levels, and the number of starts.

    Levels are pairs of the numbers of samples and of optima; the first is the coarsest that leads to optima. The starts
    include those of a level that a signal interrupted. Raises Infeasible or SolverFailed if no level leads to optima.
    """
    if rollouts is not None:
        require_feasible(task, rollouts, observe)
    stages, count = first_levels(len(task.times)), STARTS.starts if starts is None else starts
    for first in stages:
        try:
            level, rng = coarsest_level(task, first), np.random.default_rng(seed)
            q = sample_starts(level, count * max(task.redundancy, 1), rng)
            warm = q[:0] if initial is None else initial[:, np.searchsorted(task.times, level.times)]
            programs = level_programs(task, objective_scales(task, np.concatenate([warm, q])), first)
            supported = not programs[-1].unsupported
            portions = first_portions(q) if starts is None and supported else [q]
            restarts, begin = LevelRestarts(portions[1:], count, rng, solver), np.concatenate([warm, portions[0]])
            solutions, levels = refine_levels(
                programs,
                begin,
                np.ones(1),
                np.full(1, np.inf),
                observe,
                restore=True,
                further=restarts.further if supported else None,
                disturb=restarts.disturb if supported else None,
                solver=solver,
            )
        except Infeasible:  # this level may be too coarse
            if first == stages[-1]:
                raise
            continue
        if solutions.converged.any() or (solutions.status == INTERRUPTED).any():
            return solutions, levels, len(restarts.policies[0].independent) if restarts.policies else len(begin)
    # no level leads to optima; a function without a value is the first cause to name
    status, coarse = STATUSES[int(solutions.status[0])], task.subsample(solutions.x.shape[1])
    unfinished = solutions.x[solutions.status == NOT_FINITE]
    causes = evaluate_motions(coarse, coarse.motion(unfinished))[2] if len(unfinished) else ()
    if failed := [each for each in causes if each]:
        searches = f"{len(failed)} of {len(solutions)} searches"
        raise EvaluationFailed(f"no start led to an optimum; {searches} ended at a motion at which {failed[0]}")
    if solutions.violation[0] <= FEASIBLE:
        raise SolverFailed(f"no start led to an optimum; the best ended with: {status}")
    raise infeasible_error(task, coarse, solutions.x, status=status)


def _merge(task: MotionTask, solutions: Solutions, initial: Solutions) -> Solutions:
    """Return all distinct optima, after a better initial motion if there is one."""
    natural = motion_program(task)  # each batch has its own scales of objectives
    both = concatenate((solutions, initial))
    both = replace(both, objectives=np.stack([natural.evaluate(x)[0] for x in both.x]))
    initial = both[len(solutions) :]
    if both.converged.any():
        both = both[distinct_rows(task, both, both.objectives[:, 0], limit=len(both))]
    return insert_best(both[both.converged], initial, np.ones(1))


def _plan(
    task: MotionTask,
    solutions: Solutions,
    initial: Float[np.ndarray, "motions time dof"] | None,
    levels: tuple[tuple[int, int], ...],
    starts: int,
    solver: Solver,
) -> Plan:
    """Return the plan of optima, with limits between samples tightened.

    Optima that still exceed a limit come last. A given motion that satisfies its limits between samples and is better
    than all optima comes first.
    """
    program = motion_program(task, np.maximum(np.abs(task.objectives[0](task.motion(solutions.x[:1]))), 1e-300))
    results, status = hold_all(program, solutions.x, 1, solver), solutions.status
    if initial is not None and task.differences == "spline":
        initial_motions = feasible_motions(program, initial)
        results, status = [*results, *initial_motions], np.append(status, np.full(len(initial_motions), CONVERGED))
    motions = task.motion(np.stack([each.x for each in results]))
    values, labels = task.objectives[0](motions), branch_labels(motions)
    words, order = [STATUSES[int(each)] for each in status], list(range(len(solutions)))
    errors = task.discretisation_errors(motions)[:, 0]
    if task.differences == "spline":
        exceeds = [each.violation > LIMIT_TOLERANCE for each in results]  # unknown after a signal
        resolved = errors <= CERTIFICATES.resolved * np.abs(values)
        for i in np.flatnonzero(status == CONVERGED):
            words[i] = EXCEEDS if exceeds[i] else words[i] if resolved[i] else UNDER_RESOLVED
        merit = task.objectives[0].sign * values
        ranked = sorted(range(len(results)), key=lambda i: (exceeds[i], merit[i]))
        order = [i for i in ranked if i < len(solutions) or i == ranked[0]]
    optima = tuple(
        Optimum(
            motion=motions[i],
            objective=float(values[i]),
            label=labels[i],
            status=words[i],
            violation_between=results[i].violation,
            criticality=confirmed_criticality(results[i].program(program), results[i].x),
            discretisation_error=float(errors[i]),
        )
        for i in order
    )
    confirmed = sum(each.criticality <= CERTIFICATES.critical for each in optima)
    provenance = confirmation(chosen_solver(motion_program(task), solver), confirmed, len(optima))
    return Plan(optima=optima, levels=levels, starts=starts, provenance=provenance)


# Cold searches for ε-sweeps.


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionColdSearch:
    """A ``ColdSearch`` of motions: it plans single objectives, and minimises below bounds."""

    task: MotionTask
    rollouts: JointPaths
    starts: int | None
    seed: int
    solver: Solver = "auto"
    observe: Observe | None = None

    @property
    def multimodal(self) -> bool:
        """Whether local optima are many: the self-motion has several dimensions."""
        return self.task.redundancy > 1

    def optima(self, objective: int) -> Float[np.ndarray, "optima time dof"]:
        """Return the local optima of one objective, as ``find_optima`` does."""
        alone = replace(self.task, objectives=(self.task.objectives[objective],))
        names = [each.name for each in self.task.objectives]
        named = replace(self, observe=naming_objective(self.observe, names, objective))
        with explained_interruption(alone, self.rollouts, named._show) as show:
            plan = find_optima(
                alone, starts=self.starts, seed=self.seed, solver=self.solver, observe=show, rollouts=self.rollouts
            )
        return np.stack([optimum.motion.q for optimum in plan.optima])

    def optima_below(
        self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float
    ) -> Solutions | None:
        """Return one objective's optima below ``upper``, from half as many starts."""
        assert isinstance(program, MotionProgram)
        weights = np.full(len(upper), weight)
        weights[main] = 1.0
        first, starts = self._coarse_starts
        programs = level_programs(self.task, program.scales, first)
        try:
            optima = 2 * EPSILON.cold_optima  # twice as many as needed: half of them may lead elsewhere
            return refine_levels(programs, starts, weights, upper, self._show, solver=self.solver, max_optima=optima)[0]
        except Infeasible:  # all optima leave the path between samples: none is below this bound
            return None

    def _show(self, level: LevelProgress) -> None:
        if self.observe is not None:
            self.observe(level.samples, len(self.task.times), level.describe_violation(self.task))

    @cached_property
    def _coarse_starts(self) -> tuple[int, Float[np.ndarray, "starts samples dof"]]:
        """The coarsest level with starts, and these starts."""
        stages = first_levels(len(self.task.times))
        for first in stages:
            try:
                return first, initial_motions(
                    self.task, starts=-(-(self.starts or STARTS.starts) // 2), seed=self.seed, first=first
                )
            except Infeasible:  # this level may be too coarse
                if first == stages[-1]:
                    raise
        raise AssertionError("a level")
