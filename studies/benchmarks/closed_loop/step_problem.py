"""The search of a control step in pymoo, readable, for any arm, task and number of objectives.

Rows that extend the Jacobian to a square matrix are searched for (Marcos et al. 2012, section 4.1). The engine of
``paretoik/closed_loop`` runs the same search compiled; its tests and benchmarks compare it with this one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling
from pymoo.core.selection import Selection

from paretoik.arrays import Genes, Objectives
from paretoik.closed_loop.control_step import ControlStep, reach_by_joint, rotation_rows
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.closed_loop.workspace import OPTIONS
from paretoik.search.constraints import Integers
from paretoik.search.maximin import MaxiMin
from paretoik.search.row_operators import ReplaceOne, RowCrossover
from paretoik.task.motion import Motion
from paretoik.task.retraction import task_errors


def steps_to(step: ControlStep, q: Float[np.ndarray, "points dof"]) -> Step:
    """Return steps to joint positions, as objectives take them."""
    task, count = step.task, len(q)
    before = np.broadcast_to(step.history, (count, *step.history.shape))
    motion = Motion(
        arm=task.arm,
        time=task.times[step.sample] + step.dt * np.arange(-len(step.history), 1),
        q=np.concatenate([before, q[:, None]], axis=1),
        obstacles=task.obstacles,
        link_radius=task.link_radius,
    )
    error = task_errors(task.arm, task.tasks, q, step.target)[0].T
    rotations = rotation_rows(task)
    return Step(
        motion=motion,
        home=step.home,
        position_error=error[~rotations].T[:, None],
        rotation_error=error[rotations].T[:, None],
        dt=step.dt,
    )


def is_admissible(step: ControlStep, q: Float[np.ndarray, "points dof"]) -> Bool[np.ndarray, " points"]:
    """Return which steps keep within their bounds and clear of obstacles.

    Where the whole step is to be clear, it is halved until no point of the arm moves farther in an interval than the
    arm is away from obstacles at the interval's ends, both distances together. What is too near for that is not
    admissible.
    """
    moved, tolerance = q - step.previous, OPTIONS.bound_tolerance
    admissible: Bool[np.ndarray, " points"] = (
        (moved >= step.lower - tolerance) & (moved <= step.upper + tolerance)
    ).all(axis=1)
    if not step.task.obstacles or not admissible.any():
        return admissible
    moved = np.where(admissible[:, None], moved, 0.0)
    end = excess_clearances(step, step.previous + moved)
    admissible &= end > step.standoff
    if not step.swept:
        return admissible
    travel, width = np.abs(moved) @ reach_by_joint(step.task), 1.0
    index, begin = np.arange(len(q)), np.zeros(len(q))
    low, high = excess_clearances(step, step.previous[None]).repeat(len(q)), end
    while True:
        waiting = admissible[index] & (low + high <= travel[index] * width)
        index, begin, low, high = index[waiting], begin[waiting], low[waiting], high[waiting]
        if width <= OPTIONS.shortest_interval:
            admissible[index] = False
        if not index.size:
            return admissible
        width /= 2
        middle = excess_clearances(step, step.previous + (begin + width)[:, None] * moved[index])
        admissible[index[~(middle > 0)]] = False
        index, begin = np.tile(index, 2), np.concatenate([begin, begin + width])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])


def excess_clearances(step: ControlStep, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, " points"]:
    """Return by how much [m] configurations exceed the required clearance."""
    task = step.task
    motion = Motion(
        arm=task.arm,
        time=np.arange(3.0),
        q=np.repeat(q[:, None], 3, axis=1),
        obstacles=task.obstacles,
        link_radius=task.link_radius,
    )
    return motion.clearance[:, 0] - task.min_clearance


class StepProblem(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Search the rows J* and Δx* that extend Δx = J Δq to a square system (Eqs. 7 to 18): a vectorised pymoo problem.

    An individual is the matrix (redundancy, dof + 1) of these rows, flattened. F has the objectives, minimised; G, one
    column, is 1 where ``is_admissible`` says no. ``algorithm`` replaces such chromosomes before they are evaluated, as
    the paper does; where all of a step is to be clear, only the first ones, and later ones fail: their F is inf.
    """

    def __init__(self, step: ControlStep, objectives: Sequence[StepObjective]) -> None:
        self.step = step
        self.objectives = tuple(objectives)
        self.rows, self.row = step.task.redundancy, step.task.arm.dof + 1
        self._linearised = step.linearise()
        size = self.rows * self.row
        super().__init__(
            n_var=size,
            n_obj=len(self.objectives),
            n_ieq_constr=1,
            xl=-OPTIONS.gene_bound * np.ones(size),
            xu=OPTIONS.gene_bound * np.ones(size),
        )

    def decode(self, genes: Genes) -> Float[np.ndarray, "points dof"]:
        """Return the joint positions after the step; not a number where the extended Jacobian is singular."""
        error, jacobian = self._linearised
        rows = genes.reshape(-1, self.rows, self.row)
        matrix = np.concatenate([np.tile(jacobian, (len(rows), 1, 1)), rows[..., :-1]], axis=1)
        rhs = np.concatenate([np.tile(error, (len(rows), 1)), rows[..., -1]], axis=1)
        singular = np.linalg.det(matrix) == 0
        matrix[singular] = np.eye(self.row - 1)
        rhs[singular] = np.nan
        moved: np.ndarray = np.linalg.solve(matrix, rhs[..., None])[..., 0]
        return self.step.previous + moved

    def is_admissible(self, genes: Genes) -> Bool[np.ndarray, " points"]:
        """Return which chromosomes need not be replaced."""
        return is_admissible(self.step, self.decode(genes))

    def shorten(self, genes: Genes) -> Genes:
        """Return genes of steps with no more self-motion than keeps every joint within its bounds.

        What the step to the target itself takes is not shortened.
        """
        error, jacobian = self._linearised
        shortest, step = np.linalg.pinv(jacobian) @ error, self.step
        self_motion = np.nan_to_num(self.decode(genes) - step.previous - shortest)
        outside = (shortest + self_motion < step.lower) | (shortest + self_motion > step.upper)
        scale = np.maximum(
            (np.where(self_motion > 0, step.upper, step.lower) - shortest)
            / np.where(outside & (self_motion != 0), self_motion, 1.0),
            0.0,
        )
        scale = np.where(outside, np.minimum(scale, 1.0), 1.0).min(axis=1, keepdims=True)
        rows = genes.reshape(-1, self.rows, self.row)
        targets = np.einsum("prk,pk->pr", rows[..., :-1], shortest + scale * self_motion)
        extended = np.concatenate([rows[..., :-1], np.where(scale < 1, targets, rows[..., -1])[..., None]], axis=-1)
        shortened: Genes = extended.reshape(genes.shape)
        return shortened

    def score(self, q: Float[np.ndarray, "points dof"]) -> Objectives:
        """Return the objectives of steps, minimised; inf where one is not a number."""
        finite = np.isfinite(q).all(axis=1)
        F = np.full((len(q), len(self.objectives)), np.inf)
        steps = steps_to(self.step, q[finite])
        F[finite] = np.stack([objective.function(steps)[..., -1] * objective.sign for objective in self.objectives], 1)
        F[~np.isfinite(F).all(axis=1)] = np.inf
        return F

    def algorithm(self, population: int) -> GeneticAlgorithm:
        """Return the paper's NSGA-II: tournaments, crossover by rows, one gene replaced, MaxiMin selection."""
        return GeneticAlgorithm(
            pop_size=population,
            sampling=AdmissibleChromosomes(),
            selection=BinaryTournament(),
            crossover=RowCrossover(self.row),
            mutation=ReplaceOne(),
            survival=MaxiMin(),
            repair=Shorten() if self.step.swept else ReplaceInadmissible(),
            eliminate_duplicates=False,
            advance_after_initial_infill=True,
        )

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        q = self.decode(X)
        admissible, F = is_admissible(self.step, q), self.score(q)
        out["F"] = np.where(admissible[:, None], F, np.inf) if self.step.swept else F
        out["G"] = (~admissible).astype(float)[:, None]


class AdmissibleChromosomes(Sampling):  # type: ignore[misc]  # pymoo is not typed
    """Chromosomes drawn uniformly from those whose step is admissible."""

    def _do(
        self, problem: StepProblem, n_samples: int, *, random_state: np.random.Generator, **kwargs: object
    ) -> Genes:
        return replace_inadmissible(problem, _draw(problem, n_samples, random_state), random_state)


class Shorten(Repair):  # type: ignore[misc]  # pymoo is not typed
    """Steps that would go out of bounds are shortened."""

    def _do(self, problem: StepProblem, X: Genes, **kwargs: object) -> Genes:
        return problem.shorten(np.array(X, dtype=float))


class ReplaceInadmissible(Repair):  # type: ignore[misc]  # pymoo is not typed
    """A chromosome whose configuration is not admissible is rejected and a new one is drawn (section 5.2)."""

    def do(
        self, problem: StepProblem, pop: Population, random_state: np.random.Generator, **kwargs: object
    ) -> Population:
        """Return the population with such chromosomes replaced."""
        pop.set("X", replace_inadmissible(problem, pop.get("X"), random_state))
        return pop


def replace_inadmissible(problem: StepProblem, genes: Genes, rng: np.random.Generator) -> Genes:
    """Return genes of steps that are short enough, the inadmissible ones replaced by drawn ones."""
    genes = problem.shorten(np.array(genes, dtype=float))
    for _ in range(OPTIONS.max_redraws):
        inadmissible = np.flatnonzero(~problem.is_admissible(genes))
        if not inadmissible.size:
            break
        genes[inadmissible] = problem.shorten(_draw(problem, inadmissible.size, rng))
    return genes


def _draw(problem: StepProblem, count: int, rng: np.random.Generator) -> Genes:
    genes: Genes = rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))
    return genes


class BinaryTournament(Selection):  # type: ignore[misc]  # pymoo has no types
    """Of two individuals drawn with repetition the better: by rank, then by insertion distance, then by chance."""

    def _do(self, problem: Any, pop: Any, *shape: int, random_state: np.random.Generator, **kwargs: Any) -> Integers:
        rank = np.array([individual.data["rank"] for individual in pop])
        distance = np.array([individual.data["insertion_distance"] for individual in pop])
        first, second = random_state.integers(len(pop), size=(2, *shape))
        better = (rank[first] < rank[second]) | ((rank[first] == rank[second]) & (distance[first] >= distance[second]))
        chosen: Integers = np.where(better, first, second)
        return chosen
