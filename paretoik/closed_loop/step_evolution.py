"""The evolution of one control step by the compiled engine, and its last population."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, Objectives
from paretoik.closed_loop.control_step import OPTIONS, StepState
from paretoik.closed_loop.programs import (
    ORDERS,
    KeptGenerations,
    ObjectiveProgram,
    StepConstraints,
    StepPrograms,
    StepStart,
    Workspace,
    allocate,
    required_distance,
)
from paretoik.runs.journal import is_journalled, key_of, remembered


@dataclass(frozen=True, kw_only=True, eq=False)
class Population:
    """The last population of a search: genes, minimised objectives, and joint positions."""

    genes: Genes
    F: Objectives
    q: Float[np.ndarray, "points dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Generations:
    """All generations of a search: minimised objectives and joint positions, NaN if a step failed."""

    F: Float[np.ndarray, "generations individuals n_obj"]
    q: Float[np.ndarray, "generations individuals dof"]


@dataclass(kw_only=True, eq=False)
class StepEvolution:
    """The compiled search of control steps of one arm, task and set of objectives.

    With ``warm_start`` it begins with the population of the previous step. Its workspace is for one thread.
    """

    programs: StepPrograms
    redundancy: int
    objectives: int
    population: int
    generations: int
    seed: int
    warm_start: bool
    workspace: Workspace = field(init=False)

    def __post_init__(self) -> None:
        """Allocate the workspace, and the registers of the evaluators."""
        programs, self._dof = self.programs, len(self.programs.reach)
        inputs, outputs = max(programs.inputs, self._dof), len(programs.objectives.outputs)
        self.workspace = allocate(self._dof, self.redundancy, self.population, outputs, inputs)
        self._has_searched = False
        self._objectives = ObjectiveProgram(programs.objectives.arrays, programs.orders)
        self._nodes = programs.nodes.arrays

    def __call__(self, step: StepState) -> Population:
        """Search a step; the result depends only on seed and step. Raises Infeasible if the arm is singular."""
        return self._search(step, recorded=0)[0]

    def with_generations(self, step: StepState) -> tuple[Population, Generations]:
        """Search a step as a call does; return the last population and all generations."""
        population, history = self._search(step, recorded=self.generations + 1)
        F = np.where(np.isfinite(history.F).all(axis=2, keepdims=True), history.F, np.nan)
        alive = np.isfinite(F).all(axis=2)
        q = np.full((*alive.shape, self._dof), np.nan)
        q[alive] = step.decode(history.genes[alive])
        return population, Generations(F=F[:, :, : self.objectives], q=q)

    def _search(self, step: StepState, *, recorded: int) -> tuple[Population, KeptGenerations]:
        """Search a step and keep ``recorded`` generations, or read both from a stopped run's journal."""
        start, constraints = self.start_and_constraints(step)
        w = self.workspace
        before = w.genes[w.order] if self.warm_start and self._has_searched else None

        def run_search() -> dict[str, np.ndarray]:
            """Return genes (failed individuals last), objectives, and recorded generations."""
            from paretoik.closed_loop.step_search_kernels import search  # imported here: numba loads slowly

            rows = np.concatenate([step.home, step.target, self.programs.constants])
            w.inputs[ORDERS * self._dof : ORDERS * self._dof + len(rows)] = rows[:, None]
            kept = KeptGenerations(np.empty((recorded, *w.genes.shape)), np.empty((recorded, len(w.genes), len(w.F))))
            numbers = self.seed, step.sample, self.generations, OPTIONS
            alive = search(*numbers, start, self._objectives, constraints, w, before is not None, kept)
            F = w.F[: self.objectives, :alive].T.copy()
            return {"genes": w.genes[w.order], "F": F, "generation_genes": kept.genes, "generation_F": kept.F}

        numbers = self.seed, step.sample, self.generations, len(w.genes), OPTIONS
        inputs = step.history, step.home, step.target, step.lower, step.upper, step.swept, step.standoff
        key = key_of("step", *numbers, *inputs, before, recorded) if is_journalled() else None
        values = remembered(key, run_search)
        w.genes[:], w.order[:] = values["genes"], np.arange(len(w.order))  # the next step may begin with these
        self._has_searched = True
        F = values["F"]
        genes = values["genes"][: len(F)]
        history = KeptGenerations(values["generation_genes"], values["generation_F"])
        return Population(genes=genes, F=F, q=step.decode(genes)), history

    def start_and_constraints(self, step: StepState) -> tuple[StepStart, StepConstraints]:
        """Return start and constraints of a step for the engine; raises Infeasible if singular."""
        programs, task, dt = self.programs, step.task, step.dt
        shortest, null_space = step.shortest_and_null_space
        rates = [np.diff(step.history, order, axis=0)[-1] / dt**order for order in (1, 2)]
        start = StepStart(np.array(step.previous), shortest, null_space, np.array([*rates, np.zeros(self._dof)]), dt)
        constraints = StepConstraints(
            self._nodes,
            programs.obstacles,
            programs.bounding,
            *required_distance(task),
            programs.reach,
            np.array(step.lower),
            np.array(step.upper),
            step.bounded,
            step.swept,
            step.standoff,
        )
        return start, constraints
