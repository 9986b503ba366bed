"""How optima of motions are found from nothing, as ε-sweeps ask for it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions
from paretoik.pareto.cold_search import naming_objective
from paretoik.pareto.epsilon_options import OPTIONS as EPSILON
from paretoik.pareto.scalarisation import Observe
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.level_progress import LevelProgress, explained_interruption
from paretoik.trajectory.levels import first_levels, level_programs, refine_levels
from paretoik.trajectory.plan import find_optima
from paretoik.trajectory.plan_starts import initial_motions
from paretoik.trajectory.program import MotionProgram
from paretoik.trajectory.restarts import OPTIONS as RESTARTS


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionColdSearch:
    """Plans each objective alone; leads coarse starts below bounds, level by level; a ``ColdSearch``."""

    task: MotionTask
    rollouts: JointPaths
    starts: int | None
    seed: int
    solver: Solver = "auto"
    observe: Observe | None = None

    @property
    def multimodal(self) -> bool:
        """Whether valleys are many: where the self-motion has several dimensions."""
        return self.task.redundancy > 1

    def optima(self, objective: int) -> Float[np.ndarray, "optima time dof"]:
        """Return the local optima of one objective alone, best first. Raises what ``find_optima`` does."""
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
        """Return what half as many cold starts lead to for one objective, the others below ``upper``, best first."""
        assert isinstance(program, MotionProgram)
        weights = np.full(len(upper), weight)
        weights[main] = 1.0
        first, starts = self._coarse_starts
        programs = level_programs(self.task, program.scales, first)
        try:
            optima = 2 * EPSILON.cold_optima  # that many are asked for, half may end elsewhere
            return refine_levels(programs, starts, weights, upper, self._show, solver=self.solver, max_optima=optima)[0]
        except Infeasible:  # all that is found leaves the path between samples: nothing below this bound
            return None

    def _show(self, level: LevelProgress) -> None:
        if self.observe is not None:
            self.observe(level.samples, len(self.task.times), level.describe_violation(self.task))

    @cached_property
    def _coarse_starts(self) -> tuple[int, Float[np.ndarray, "starts samples dof"]]:
        """The coarsest level that has starts, and these."""
        stages = first_levels(len(self.task.times))
        for first in stages:
            try:
                return first, initial_motions(
                    self.task, starts=-(-(self.starts or RESTARTS.starts) // 2), seed=self.seed, first=first
                )
            except Infeasible:  # too coarse, perhaps
                if first == stages[-1]:
                    raise
        raise AssertionError("a level")
